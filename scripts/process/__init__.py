"""What a command's process is asked and how it tells: signals, standard streams."""
