//! Compensates the axes within limits of size, rate and acceleration.
