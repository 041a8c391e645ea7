//! A five-axis machine with its own physics that stands in for hardware.
