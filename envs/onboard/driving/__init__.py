"""How a robot drives to a target among others."""
