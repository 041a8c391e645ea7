//! ROS shell of recorder.
