//! ROS shell of probe.
