"""What describes an occupancy map: its corners, with a descriptor of each."""
