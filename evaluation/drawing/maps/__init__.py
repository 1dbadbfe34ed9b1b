"""Pictures of maps in space."""
