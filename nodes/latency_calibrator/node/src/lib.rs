//! ROS shell of latency_calibrator.
