"""The study of SLAM on recorded logs, with a simulated robot beside."""
