//! Figures in the units in which people read them.

use history::Series;
use reports::positioning::shown_title;
use reports::section;

/// A unit for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Its value over that of the kept unit.
    pub factor: f64,
    /// Its sign.
    pub unit: String,
}

/// Uncertainties below this are written with a power of ten.
const TINY: f64 = 1e-4;
/// rad to seconds of arc.
const RAD_ARCSEC: f64 = 648_000.0 / std::f64::consts::PI;

/// The unit in which a series is shown: lengths in µm, angles of rotary axes in arcsec, other angles in µrad.
pub fn shown(series: &Series) -> Shown {
    let (factor, unit) = match series.unit.as_str() {
        "mm" => (1e3, "µm"),
        "rad" if series.name.starts_with("iso230_2_rotary") => (RAD_ARCSEC, "arcsec"),
        "rad" => (1e6, "µrad"),
        "s" if series.name.starts_with("latency") => (1e6, "µs"),
        "um" => (1.0, "µm"),
        other => (1.0, other),
    };
    Shown {
        factor,
        unit: unit.to_owned(),
    }
}

impl Shown {
    /// A value in it, with as many decimals as its uncertainty needs.
    pub fn value(&self, value: f64, standard_uncertainty: Option<f64>) -> String {
        let value = value * self.factor;
        match standard_uncertainty.filter(|u| *u > 0.0) {
            Some(u) if is_tiny(2.0 * u * self.factor) => format!("{value:.1e}"),
            Some(u) => section::rounded(value, 2.0 * u * self.factor).0,
            None => plain(value),
        }
    }

    /// An expanded uncertainty (k = 2) in it.
    pub fn expanded(&self, standard_uncertainty: Option<f64>) -> String {
        match standard_uncertainty.filter(|u| *u > 0.0) {
            Some(u) if is_tiny(2.0 * u * self.factor) => format!("{:.1e}", 2.0 * u * self.factor),
            Some(u) => section::rounded(0.0, 2.0 * u * self.factor).1,
            None => "—".to_owned(),
        }
    }

    /// A value and half of its interval, as `1.23 ± 0.45 µm`.
    pub fn with_half_width(&self, value: f64, half_width: f64) -> String {
        let (value, half_width) = (value * self.factor, half_width * self.factor);
        if half_width > 0.0 {
            let (value, half_width) = section::rounded(value, half_width);
            format!("{value} ± {half_width} {}", self.unit)
        } else {
            format!("{} {}", plain(value), self.unit)
        }
    }
}

/// Whether a number has more decimals than a table has room for.
fn is_tiny(value: f64) -> bool {
    value < TINY
}

/// Four digits.
fn plain(value: f64) -> String {
    if value.abs() < f64::MIN_POSITIVE {
        return "0".to_owned();
    }
    let digits = 3.0 - value.abs().log10().floor();
    if (0.0..=9.0).contains(&digits) {
        format!("{value:.*}", digits as usize)
    } else if digits < 0.0 && value.abs() < 1e9 {
        format!("{value:.0}")
    } else {
        format!("{value:.3e}")
    }
}

/// The name of a series: test, figure and axis.
pub fn title(series: &Series) -> String {
    let axis = if series.axis.is_empty() {
        String::new()
    } else {
        format!(" {}", series.axis)
    };
    if series.test.is_empty() {
        return format!("{}{axis}", series.name);
    }
    format!("{}{axis}, {}", series.name, shown_title(&series.test))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(name: &str, unit: &str) -> Series {
        Series {
            id: 1,
            machine: "m".to_owned(),
            test: "t".to_owned(),
            name: name.to_owned(),
            axis: "X".to_owned(),
            unit: unit.to_owned(),
        }
    }

    #[test]
    fn lengths_are_um_and_angles_of_rotary_axes_arcsec() {
        let length = shown(&series("iso230_2.accuracy", "mm"));
        assert_eq!(length.value(0.012_347, Some(0.0005)), "12.3");
        assert_eq!(length.expanded(Some(0.0005)), "1.0");
        assert_eq!(length.with_half_width(0.012_347, 0.0004), "12.35 ± 0.40 µm");
        let rotary = shown(&series("iso230_2_rotary.figures.both.accuracy", "rad"));
        assert_eq!(rotary.value(5f64.to_radians() / 3600.0, None), "5.000");
        assert_eq!(shown(&series("geometry.EC0Y", "rad")).unit, "µrad");
        let cubic = shown(&series("geometry.ECY3", ""));
        assert_eq!(cubic.value(-8.99e-12, Some(4e-12)), "-9.0e-12");
        assert_eq!(cubic.expanded(Some(4e-12)), "8.0e-12");
        assert_eq!(
            shown(&series("effect.backlash.width_um", "um")).value(6.0, None),
            "6.000"
        );
    }

    #[test]
    fn numbers_without_uncertainty_have_four_digits() {
        for (value, text) in [
            (0.0, "0"),
            (12_345.0, "12345"),
            (1.5, "1.500"),
            (1e-12, "1.000e-12"),
            (-0.02, "-0.02000"),
        ] {
            assert_eq!(plain(value), text);
        }
    }
}
