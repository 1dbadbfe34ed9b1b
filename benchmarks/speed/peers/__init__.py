"""What the package is compared with. Other simulators are optional: if one is not installed, its lines say so."""
