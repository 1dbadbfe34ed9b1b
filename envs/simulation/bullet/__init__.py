"""The world with bodies simulated by PyBullet."""
