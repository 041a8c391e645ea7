//! Estimates the transmission latency of a touch probe.
