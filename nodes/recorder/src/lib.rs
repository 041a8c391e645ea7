//! Records topics to MCAP in the layout of rosbag2.
