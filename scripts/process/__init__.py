"""How a command behaves as a process: signals, streams, its first start."""
