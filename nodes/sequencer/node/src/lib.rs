//! ROS shell of sequencer.
