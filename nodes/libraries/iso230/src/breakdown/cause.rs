//! Names and units of the rows, and where to look for each of them.

use super::report::{Alias, Unit};
use super::scene::Scene;
use super::search::Kind;
use super::squareness;
use super::term::{BacklashEnd, RowKey};
use metrology::squareness::between;

/// Unit of a row's value.
pub(super) const fn unit(key: &RowKey) -> Unit {
    match key {
        RowKey::RadialExpansion | RowKey::ScalingMismatch => Unit::MmPerMm,
        RowKey::Squareness => Unit::Rad,
        RowKey::ServoMismatch => Unit::S,
        RowKey::RadiusContraction => Unit::S2,
        RowKey::Straightness { .. } | RowKey::QuadraticPitch { .. } => Unit::PerMm,
        RowKey::Drift => Unit::MmPerS,
        RowKey::CentreOffset { .. }
        | RowKey::ReferenceLength { .. }
        | RowKey::Backlash { .. }
        | RowKey::LateralPlay { .. }
        | RowKey::ReversalSpike { .. }
        | RowKey::Cyclic { .. }
        | RowKey::Vibration { .. }
        | RowKey::Lobes { .. }
        | RowKey::VibrationOrLobes { .. } => Unit::Mm,
    }
}

/// Name of one cause.
pub(super) fn name(key: &RowKey, scene: &Scene) -> String {
    let [first, second] = scene.axes;
    let plane = scene.name();
    match *key {
        RowKey::CentreOffset { axis, zero } => format!("centre offset {axis} (zero {zero})"),
        RowKey::ReferenceLength { reference } => format!("reference length {reference}"),
        RowKey::RadialExpansion => format!("radial expansion {plane}"),
        RowKey::ScalingMismatch => format!("scaling mismatch {first}-{second}"),
        RowKey::Squareness => {
            let component = between(first, second).map(|component| format!(" ({component})"));
            format!("squareness {plane}{}", component.unwrap_or_default())
        }
        RowKey::ServoMismatch => format!("servo mismatch {first}-{second}"),
        RowKey::RadiusContraction => format!("radius contraction {plane}"),
        RowKey::Backlash {
            axis,
            end: BacklashEnd::Positive,
        } => format!("backlash {axis}+"),
        RowKey::Backlash {
            axis,
            end: BacklashEnd::Negative,
        } => format!("backlash {axis}-"),
        RowKey::LateralPlay { axis } => format!("lateral play {axis}"),
        RowKey::Straightness { axis } => format!("straightness {axis}"),
        RowKey::QuadraticPitch { axis } => format!("quadratic pitch error {axis}"),
        RowKey::Drift => "drift".to_owned(),
        RowKey::ReversalSpike {
            axis,
            feed_mm_s,
            radius_mm,
        } => {
            format!(
                "reversal spike {axis} at {:.0} mm/min, R {radius_mm} mm",
                60.0 * feed_mm_s
            )
        }
        RowKey::Cyclic { axis, pitch_mm } => format!("cyclic error {axis}, period {pitch_mm} mm"),
        RowKey::Vibration { hz, along } => format!("vibration{} {hz:.2} Hz", of(along)),
        RowKey::Lobes { per_turn, along } => format!("{per_turn:.2} lobes a turn{}", of(along)),
        RowKey::VibrationOrLobes {
            hz,
            per_turn,
            along,
        } => {
            format!(
                "vibration{} {hz:.2} Hz or {per_turn:.2} lobes a turn",
                of(along)
            )
        }
    }
}

fn of(along: Option<metrology::Axis>) -> String {
    along.map_or_else(String::new, |axis| format!(" of {axis}"))
}

/// Name of a row with all that is in its value.
pub(super) fn name_with(own: &str, aliases: &[Alias]) -> String {
    aliases.iter().fold(own.to_owned(), |name, alias| {
        let sign = if alias.coefficient < 0.0 { '−' } else { '+' };
        format!("{name} {sign} {}", alias.name)
    })
}

/// Name of something that is looked for.
pub(super) fn kind_name(kind: Kind, scene: &Scene) -> String {
    match kind {
        Kind::Spike(axis) => format!("reversal spike {}", scene.axes[axis]),
        Kind::Cyclic(axis) => format!("cyclic error {}", scene.axes[axis]),
        Kind::Tone => "vibration".to_owned(),
    }
}

/// Where to look, for a value of this sign.
pub(super) fn cause(key: &RowKey, value: f64, scene: &Scene) -> String {
    let [first, second] = scene.axes;
    let positive = value >= 0.0;
    match *key {
        RowKey::CentreOffset { .. } => "setting up: the circle's centre is not where it was taken".to_owned(),
        RowKey::ReferenceLength { .. } => "setting up: the reference is not as long as stated".to_owned(),
        RowKey::RadialExpansion => {
            let way = if positive { "too far" } else { "too short" };
            format!("both axes travel {way}: temperature of scales or screws, or a common pitch error")
        }
        RowKey::ScalingMismatch => {
            let (long, short) = if positive { (first, second) } else { (second, first) };
            format!("{long} travels farther than {short}: pitch error, a screw that is warmer or stretched")
        }
        RowKey::Squareness => {
            let opens = squareness::sign(scene.axes) * value > 0.0;
            let way = if opens { "more" } else { "less" };
            format!("{first}+ and {second}+ enclose {way} than 90°: guideway alignment, worn guides, foundation")
        }
        RowKey::ServoMismatch => {
            let late = if positive { first } else { second };
            format!("{late} lags more: raise its position gain or feed-forward, or lower the other's")
        }
        RowKey::RadiusContraction if positive => {
            "the servos lag and cut the circle: position gain or feed-forward too low".to_owned()
        }
        RowKey::RadiusContraction => "the servos overshoot the circle: feed-forward too high".to_owned(),
        RowKey::Backlash { axis, .. } if positive => {
            format!("{axis} stays behind at reversal: play in nut, bearing or coupling, wind-up of the screw")
        }
        RowKey::Backlash { axis, .. } => {
            format!("{axis} runs ahead at reversal: backlash compensation too large")
        }
        RowKey::LateralPlay { axis } => format!("{axis} moves sideways at reversal: play in its guides"),
        RowKey::Straightness { axis } => format!("the guide of {axis} is bent"),
        RowKey::QuadraticPitch { axis } => format!("the pitch error of {axis} is not linear"),
        RowKey::Drift => "the radius changes with time: temperature, a slipping mount, or where one axis takes over as master".to_owned(),
        RowKey::ReversalSpike { axis, .. } if positive => {
            format!("{axis} sticks at reversal: friction, its compensation too small or too late")
        }
        RowKey::ReversalSpike { axis, .. } => {
            format!("{axis} is pushed through at reversal: friction compensation too large")
        }
        RowKey::Cyclic { axis, .. } => {
            format!("{axis} errs once a period: eccentric screw or bearing, encoder coupling, scale signals")
        }
        RowKey::Vibration { .. } => "same frequency at each feed: stick-slip, a loop near its limit, the surroundings".to_owned(),
        RowKey::Lobes { .. } => "same place at each feed: a form of the guides or the interpolation, not vibration".to_owned(),
        RowKey::VibrationOrLobes { .. } => {
            "vibration, or lobes that stay in place: seen at one angular speed only".to_owned()
        }
    }
}
