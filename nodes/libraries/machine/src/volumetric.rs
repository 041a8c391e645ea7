//! Error of the tool tip relative to the workpiece from the geometric errors of the axes.
//!
//! `member` gives the axes in order from the tool to the workpiece and what each does nominally to
//! the tip. `component` says which ISO 230-1 components a chain has and which of them it needs,
//! `sensitivity` what one unit of one of them does to the tip. `turn` turns points exactly and fast. `curve` evaluates published error
//! motions, `model` puts all of them together, `inverse` says what has to be commanded to undo them.
//!
//! # Conventions
//!
//! The functional point (tool tip) is at `t` from the reference point that the positions name:
//! with rotary axes at zero the tip is nominally at q + t in the workpiece frame. There is no tool
//! length compensation in here. The workpiece frame has the machine's directions when the rotary
//! axes are at zero.
//!
//! A component's value is the motion of the *tool relative to the workpiece* that it causes. An axis
//! that carries the workpiece has the sign turned against the motion of its own body: a table whose
//! body runs 1 µm too far towards its own -X (commanded X + 10) has EXX = +1 µm.
//!
//! ```text
//!   p_w = G_1 G_2 .. G_n t          members from the workpiece to the tool             (1)
//!   linear, carries the workpiece:  G = E(q) T(q d),        E = T(e) R(w)              (2)
//!   linear, carries the tool:       G = T(q d) E(q)                                    (3)
//!   rotary, carries the workpiece:  G = L J(q) L^-1 E(q),   J = T(o) R(n, -s q) T(-o)  (4)
//!   rotary, carries the tool:       G = E(q) L J(q) L^-1,   J = T(o) R(n, q) T(-o)     (5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | q | position of the axis | mm, rad |
//! | e, w | error motions EX. EY. EZ. and EA. EB. EC. at q; R(w) turns about w by its length | mm, rad |
//! | d | direction of motion, turned by the squareness: R(EA0., EB0., EC0.) of the axis' letter | 1 |
//! | n, o | nominal direction and a point of the line of a rotary axis (`origin_mm`) | 1, mm |
//! | L | location errors of a rotary axis: T(o) T(EX0., EY0., EZ0.) R(EA0., EB0., EC0.) T(-o) | |
//! | s | +1 where a positive command turns the table itself right-handed | 1 |
//!
//! *Where angular errors turn.* A linear axis turns what it carries about the origin of its own
//! frame, which is the machine's origin when that axis and those between it and the bed are at zero,
//! and which moves with the axis: hence E beside the moved body in (2) and (3). A rotary axis is
//! displaced and tilted in the directions of what it is mounted on, about the point o of its line:
//! hence E on the bed's side in (4) and (5).
//!
//! *Squareness.* EC0Y turns the direction in which Y moves the tool relative to the workpiece about
//! +Z: look down on the table, X to the right, Y up; with EC0Y > 0 the tool's path for +Y leans to
//! the left, from +Y towards -X, and the tip is at -EC0Y y in X. X is the primary axis, Y the second:
//! the linear part of EXY and EYX is booked there and nowhere else. EB0Z > 0 leans +Z towards +X,
//! EA0Z > 0 leans +Z towards -Y.
//!
//! *Location of rotary axes.* EX0C is the displacement of the line of rotation in machine directions
//! with all axes at zero, EA0C its tilt about X; each line by itself, so that a displaced A does not
//! carry C along. Workpiece and tool are set up with the rotary axes at zero, so that nothing is to be
//! seen there: L J L^-1 is the identity at q = 0. For a table the tip is off by (1 - R^-1) e in
//! the workpiece, which is (R - 1) e in machine directions.
//!
//! *Zero position.* EA0A turns what the axis carries by a constant, as a constant EAA would. In a
//! head this tilts the tool at every position. On a table the workpiece datum takes it up at rotary
//! axes zero: for the table next to the workpiece nothing is left, for one that carries another it is
//! a tilt of that one's line, which has its own name.
//!
//! # Holds when
//! Rigid bodies; each error motion depends on the position of its own axis alone. Not modelled: sag
//! that depends on another axis, direction of motion (backlash), temperature.
//!
//! # References
//! \[1\] ISO 230-1:2012, 3.4 and 3.6, annex A. \[2\] ISO 10791-6:2014, chain strings.

pub mod component;
mod curve;
pub mod error;
pub mod inverse;
mod member;
pub mod model;
pub mod sensitivity;
mod turn;

pub use component::{components_of, has_component, lean};
pub use curve::{Alone, check as check_curve, on_line};
pub use error::{PoseRefusal, VolumetricError};
pub use model::VolumetricModel;
pub use sensitivity::sensitivity;
