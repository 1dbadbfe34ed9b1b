"""What the package is compared with.

Other simulators are optional: where one is not installed, its lines say so.
"""
