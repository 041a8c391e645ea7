//! How much one message may hold; a reader refuses more before it makes anything of it.
//!
//! The interface files know no limits, and a limit in them would change every type hash. So the limits
//! stand here, far above what any node of ours writes. Numbers have [`crate::wire`]'s own bound.

use metrology::bound::Range;

/// Bytes of a name: of a feature, a sensor, a stylus, a host.
pub(crate) use metrology::bound::NAME_BYTES;
/// Names in a list: the features of a test.
pub(crate) const NAMES: usize = 1_000;
/// Bytes of a sentence: what a machine reports in words.
pub(crate) const SENTENCE_BYTES: usize = 64 * 1024;
/// Curves of a geometry model: each of six axes has six errors, and each may be in parts.
pub(crate) const CURVES: usize = 200;
/// Coefficients of all curves of a model together: its covariance has the square of it, 32 MiB.
pub(crate) const COEFFICIENTS: usize = 2_000;
/// Combinations of coefficients that are estimable.
pub(crate) const COMBINATIONS: usize = COEFFICIENTS;
/// Weights of all combinations together.
pub(crate) const WEIGHTS: usize = 1_000_000;
/// Power of a polynomial: those that are fitted go to five.
pub(crate) const POWER: u8 = 20;
/// Points of a positioning table: what a control takes is below 10,000.
pub(crate) const TABLE_POINTS: usize = 100_000;
/// Position in a positioning table: the longest machines have some 100 m of travel.
pub(crate) const POSITION_M: Range = Range::new(-1_000.0, 1_000.0, " m");
/// The same of a rotary axis: some 160 turns.
pub(crate) const POSITION_RAD: Range = Range::new(-1_000.0, 1_000.0, " rad");
/// Deviation in a positioning table: a scale and a motor encoder that differ by more do not watch one axis.
pub(crate) const DEVIATION_M: Range = Range::new(-0.1, 0.1, " m");
/// The same of a rotary axis.
pub(crate) const DEVIATION_RAD: Range = Range::new(-1.0, 1.0, " rad");
/// Weight of a new measurement in a positioning table, as its interface file says.
pub(crate) const TABLE_WEIGHT: Range = Range::new(0.0, 0.3, "");
/// Causes of a gap, parameters of one, runs that were looked at.
pub(crate) const CAUSES: usize = 1_000;
/// Runs that a report names.
pub(crate) const RUNS: usize = 100_000;
/// Touches of a probed feature.
pub(crate) const TOUCHES: usize = 100_000;
