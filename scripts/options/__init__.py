"""Options of commands that stand for settings of a part."""
