//! Runs measuring cycles and scenario steps on a controller.
