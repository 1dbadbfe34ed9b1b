"""The study of robots in worlds that are not ideal."""
