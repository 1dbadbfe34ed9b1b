"""The forms in which trainers take observations, rewards, infos, ends of agents."""
