//! ROS shell of thermal_model.
