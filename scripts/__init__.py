"""One file per command of ``lidarium``."""
