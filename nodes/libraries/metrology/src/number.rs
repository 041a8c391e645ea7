//! Numbers as a message shows them, and the unit that the name of a quantity ends with.

use crate::axis::Axis;

/// Significant digits of a number in a message.
const DIGITS: usize = 6;
/// Whole numbers below this are exact in a double and are printed whole.
const WHOLE_BELOW: f64 = 1e15;
/// Magnitudes outside this range are printed with an exponent.
const PLAIN: std::ops::Range<f64> = 1e-5..1e9;

/// A number with at most six significant digits, without the noise of binary fractions: `29.999999999999996` is `30`.
#[must_use]
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    let size = value.abs();
    if value.fract().abs() <= 0.0 && size < WHOLE_BELOW {
        // Without the sign of a negative zero.
        return format!("{}", value + 0.0);
    }
    let rounded = format!("{value:.*e}", DIGITS - 1);
    let rounded: f64 = rounded.parse().unwrap_or(value);
    if PLAIN.contains(&size) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// Decimals of a value, of whose uncertainty two digits are shown; 2 without one.
#[must_use]
pub fn decimals_of(uncertainty: f64) -> usize {
    if uncertainty.is_finite() && uncertainty > 0.0 {
        (1.0 - uncertainty.log10().floor()).clamp(0.0, 9.0) as usize
    } else {
        2
    }
}

/// A number with the unit of its name: `12.5 mm`; a name without a unit gives the number alone.
#[must_use]
pub fn quantity(name: &str, value: f64) -> String {
    match unit_of(name) {
        Some(unit) => format!("{} {unit}", number(value)),
        None => number(value),
    }
}

/// An angle of `rad` in degrees with one digit, as people read it.
#[must_use]
pub fn degrees(rad: f64) -> String {
    format!("{:.1} deg", rad.to_degrees())
}

/// A position of an axis, or a length along it: mm, or radians shown as degrees.
#[must_use]
pub fn along(axis: Axis, value: f64) -> String {
    if axis.is_linear() {
        format!("{} mm", number(value))
    } else {
        format!("{} deg", number(value.to_degrees()))
    }
}

/// Units by their spelling in names.
const UNITS: [(&str, &str); 42] = [
    ("mm", "mm"),
    ("um", "µm"),
    ("nm", "nm"),
    ("m", "m"),
    ("mm2", "mm²"),
    ("m2", "m²"),
    ("m3", "m³"),
    ("rad", "rad"),
    ("mrad", "mrad"),
    ("urad", "µrad"),
    ("deg", "deg"),
    ("arcsec", "arcsec"),
    ("s", "s"),
    ("s2", "s²"),
    ("s3", "s³"),
    ("ms", "ms"),
    ("us", "µs"),
    ("min", "min"),
    ("h", "h"),
    ("hz", "Hz"),
    ("k", "K"),
    ("k2", "K²"),
    ("degc", "°C"),
    ("w", "W"),
    ("j", "J"),
    ("mj", "MJ"),
    ("kg", "kg"),
    ("kgm2", "kg m²"),
    ("n", "N"),
    ("kn2", "kN²"),
    ("gpa", "GPa"),
    ("nanos", "ns"),
    ("ns", "ns"),
    ("v", "V"),
    ("a", "A"),
    ("percent", "%"),
    ("ppm", "ppm"),
    ("rpm", "1/min"),
    ("rev", "rev"),
    ("bytes", "bytes"),
    ("turns", "turns"),
    ("turn", "turn"),
];
/// Units that are products, by the spelling of their words, and names of quantities that have one unit or another.
const PRODUCTS: [(&[&str], &str); 5] = [
    (&["n", "m"], "N m"),
    (&["n", "s"], "N s"),
    (&["n", "m", "s"], "N m s"),
    (&["kg", "m2"], "kg m²"),
    (&["um", "urad"], "µm or µrad"),
];

fn symbol(word: &str) -> Option<&'static str> {
    UNITS
        .iter()
        .find(|(spelled, _)| *spelled == word)
        .map(|(_, symbol)| *symbol)
}

/// Whether a unit that follows another one divides it without the word `per`, as in `feed_mm_min`.
fn is_of_time(word: &str) -> bool {
    matches!(word, "s" | "s2" | "s3" | "min" | "h")
}

/// The unit with which the name of a quantity ends: `feed_mm_min` gives `mm/min`, `expansion_um_per_m_k` gives
/// `µm/(m K)`. Names are dotted paths too, with places of lists in brackets.
#[must_use]
pub fn unit_of(name: &str) -> Option<String> {
    let last = name.rsplit('.').next().unwrap_or(name);
    let last = last.split('[').next().unwrap_or(last);
    let words: Vec<&str> = last.split('_').collect();
    let words = without_condition(&words);
    // The longest end that is a unit; a word in front of it is the quantity, which a rate needs not have.
    let first = usize::from(words.first() != Some(&"per"));
    (first..words.len()).find_map(|from| unit(&words[from..]))
}

/// A name without the condition under which its quantity has the value: `motor_w_at_1000_rpm`.
fn without_condition<'a, 'w>(words: &'a [&'w str]) -> &'a [&'w str] {
    let is_condition = |two: &[&str]| two[0] == "at" && two[1].parse::<u32>().is_ok();
    match words.windows(2).position(is_condition) {
        Some(at) => &words[..at],
        None => words,
    }
}

/// A whole list of words as one unit.
fn unit(words: &[&str]) -> Option<String> {
    let per = words.iter().position(|word| *word == "per");
    let (above, below) = match per {
        Some(at) => (&words[..at], &words[at + 1..]),
        None if words.len() == 2 && is_of_time(words[1]) => words.split_at(1),
        None => (words, &words[..0]),
    };
    if per.is_some() && below.is_empty() {
        return None;
    }
    let above = match above {
        [word] => symbol(word)?,
        [] if per.is_some() => "1",
        several => PRODUCTS.iter().find(|(words, _)| *words == several)?.1,
    };
    let below: Vec<&str> = below
        .iter()
        .map(|word| symbol(word))
        .collect::<Option<_>>()?;
    Some(match below.as_slice() {
        [] => above.to_owned(),
        [one] => format!("{above}/{one}"),
        several => format!("{above}/({})", several.join(" ")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_no_noise_and_no_more_than_six_digits() {
        for (value, shown) in [
            (29.999_999_999_999_996, "30"),
            (6.173_522_989_057_789, "6.17352"),
            (-1.284_683_259_253_4, "-1.28468"),
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (86_400.0, "86400"),
            (1_767_600_000.0, "1767600000"),
            (0.1 + 0.2, "0.3"),
            (1.234_567_8e-7, "1.23457e-7"),
            (9.999_999_9e-6, "1e-5"),
            (1e300, "1e300"),
            (f64::NAN, "NaN"),
            (f64::NEG_INFINITY, "-inf"),
        ] {
            assert_eq!(number(value), shown, "{value:?}");
        }
    }

    #[test]
    fn the_unit_is_the_end_of_the_name() {
        for (name, unit) in [
            ("feed_mm_min", Some("mm/min")),
            ("axes.X.acceleration_limit_mm_s2", Some("mm/s²")),
            ("expansion_um_per_m_k", Some("µm/(m K)")),
            ("position_gain_per_s", Some("1/s")),
            ("travel_mm[1]", Some("mm")),
            ("conductance_w_per_k", Some("W/K")),
            ("limit_min", Some("min")),
            ("temperature_degc", Some("°C")),
            ("drift_us_per_s", Some("µs/s")),
            ("torque_limit_n_m", Some("N m")),
            ("motor_inertia_kg_m2", Some("kg m²")),
            ("viscous_n_s_per_mm", Some("N s/mm")),
            ("viscous_n_m_s_per_rad", Some("N m s/rad")),
            ("gear_stiffness_n_m_per_arcsec[0]", Some("N m/arcsec")),
            ("convection_w_per_m2_k", Some("W/(m² K)")),
            ("heat_capacity_mj_per_m3_k", Some("MJ/(m³ K)")),
            ("motor_loss_w_per_kn2", Some("W/kN²")),
            ("front_bearing_w_at_1000_rpm", Some("W")),
            ("wavelength_drift_ppm_per_h", Some("ppm/h")),
            ("stem_modulus_gpa", Some("GPa")),
            ("drives.X.per_turn", Some("1/turn")),
            ("bow_um_urad", Some("µm or µrad")),
            ("damping", None),
            ("repeats", None),
            ("id", None),
            ("n", None),
            ("approach_sign[2]", None),
        ] {
            assert_eq!(unit_of(name).as_deref(), unit, "{name}");
        }
        assert_eq!(quantity("axes.X.lead_mm", -9.999_999_999_999_998), "-10 mm");
        assert_eq!(along(Axis::X, 0.1 + 0.2), "0.3 mm");
        assert_eq!(along(Axis::C, std::f64::consts::FRAC_PI_6), "30 deg");
        assert_eq!(degrees(std::f64::consts::PI / 18.0), "10.0 deg");
    }
}
