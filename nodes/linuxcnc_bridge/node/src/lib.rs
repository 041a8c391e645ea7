//! ROS shell of linuxcnc_bridge.
