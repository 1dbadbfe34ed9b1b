"""The world whose bodies PyBullet moves."""
