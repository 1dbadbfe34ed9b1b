"""Many episodes at once: one kernel call steps them all.

It serves Gymnasium's vector environments and stable-baselines3.
"""
