//! Blind trials on sessions of a small plant with its own formulas: no effect, one, two, an unknown one, and
//! noise that the repeats do not show.

mod blocks;
mod changes;
mod cold;
mod described;
mod dice;
mod form;
mod named;
mod next;
mod nulls;
mod plant;
mod scatter;
mod unnamed;
