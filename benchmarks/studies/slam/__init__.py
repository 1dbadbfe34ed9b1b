"""The study of SLAM on recorded logs and on a simulated robot."""
