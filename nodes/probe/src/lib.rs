//! Corrects touches for latency and stylus radius and evaluates touching cycles.
