//! Which geometric errors a machine has, from the path of its tool over a plane grid.
//!
//! A head in the spindle reads where it stands over a plate on the table, in two coordinates, while the
//! machine moves along circles, arcs, lines and corners. What the readings differ from the axes' own positions
//! is the sum of all geometric errors there, as levers and tool offset let them act, and of how the plate
//! happens to lie. `recording` makes points of readings; `basis` says how a component depends on its axis,
//! `unknown` what is unknown besides, `equations` puts both into rows; `triangle` and `spectrum` solve them
//! and tell what they see, `combination` what they see only together; `identify` is the whole fit and
//! `geometry` what is published of it. `published` is the source's own solution, which prints single errors
//! that one circle cannot tell, `comparison` shows both. `reference_lines` is squareness as ISO 230-1 defines it. `preflight` says before a measurement what it will see. `trace` lays out
//! the picture. `axis_log` and `stage` are the node.
//!
//! On one circle about the origin, x = R cos θ, y = R sin θ, for `[w X' Y' b Z t]` with φ taken as C_x = φ y
//! and a = EXX, b = EXY (b' with the yaw of Y in it), c = EYX, d = EYY, the radial trace is
//!
//! ```text
//!   1: R(a₁+d₁)/2 + 3R³(a₃+d₃)/8    cos2: R(a₁−d₁)/2 + R³(a₃−d₃)/2    cos4: R³(a₃+d₃)/8       (1)
//!   cos1: R²(3a₂+b₂')/4             cos3: R²(a₂−b₂')/4                                            (2)
//!   sin1: R²(3d₂+c₂)/4              sin3: R²(c₂−d₂)/4                                             (3)
//!   sin2: Rφ/2 + R³(b₃'+c₃)/4       sin4: R³(c₃−b₃')/8                                            (4)
//! ```
//!
//! Nine numbers from fourteen unknowns: hence rank 9, and 10 with the cubic yaw of Y, which alone gives cos5.
//!
//! # Agreement
//! `val_numpy_rank_table_of_the_measuring_programmes`: all 27 ranks. `eq1_eq4_…` in tests/harmonics.rs: 1e-9 mm.

pub mod axis_log;
pub mod basis;
pub mod combination;
pub mod comparison;
pub mod config;
pub mod diagnostic;
pub mod equations;
pub mod error;
pub mod geometry;
pub mod identify;
mod open;
pub mod preflight;
pub mod published;
pub mod recording;
pub mod reference_lines;
pub mod spectrum;
pub mod stage;
pub mod trace;
pub mod triangle;
pub mod unknown;

pub use config::GridEncoderConfig;
pub use error::{GridEncoderError, IdentifyError};
pub use stage::{GridEncoderStage, Input, Output};
