//! ROS shell of axis_compensation.
