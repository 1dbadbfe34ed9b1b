"""The faces of the engine: PettingZoo, Gymnasium and stable-baselines3."""
