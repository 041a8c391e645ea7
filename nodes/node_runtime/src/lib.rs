//! Runs nodes on ROS 2: the only crate that knows it.
