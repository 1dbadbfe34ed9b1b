"""Many episodes at once: one kernel call steps them all, for Gymnasium's vector environments and for stable-baselines3."""
