"""What a robot explores by its depth camera: ground seen, frontiers, views, routes."""
