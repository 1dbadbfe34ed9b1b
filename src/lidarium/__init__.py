"""lidarium: teams of lidar robots explore unknown floors."""

__version__ = "0.1.0"
