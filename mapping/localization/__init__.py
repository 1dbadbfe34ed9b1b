"""Where robots believe they are: localizers on odometry and scans, all behind one protocol."""
