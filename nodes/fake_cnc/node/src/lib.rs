//! ROS shell of fake_cnc.
