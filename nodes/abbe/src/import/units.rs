//! Units in which columns of a table are written.

use serde::Deserialize;

/// A unit of a length, an angle, a time or a temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub enum Unit {
    /// Nanometre.
    #[serde(rename = "nm")]
    Nm,
    /// Micrometre.
    #[serde(rename = "um", alias = "µm", alias = "μm")]
    Um,
    /// Millimetre.
    #[serde(rename = "mm")]
    Mm,
    /// Centimetre.
    #[serde(rename = "cm")]
    Cm,
    /// Metre.
    #[serde(rename = "m")]
    Metre,
    /// Inch, 25.4 mm.
    #[serde(rename = "inch", alias = "in")]
    Inch,
    /// A thousandth of an inch, 25.4 µm; `mil` is refused: it is an angle and a millimetre too.
    #[serde(rename = "thou")]
    Thou,
    /// A millionth of an inch, 25.4 nm.
    #[serde(rename = "uin", alias = "µin", alias = "μin")]
    Uin,
    /// Degree.
    #[serde(rename = "deg", alias = "°")]
    Deg,
    /// A four-hundredth of a turn.
    #[serde(rename = "gon")]
    Gon,
    /// A turn.
    #[serde(rename = "turn")]
    Turn,
    /// Minute of arc.
    #[serde(rename = "arcmin")]
    Arcmin,
    /// Second of arc.
    #[serde(rename = "arcsec")]
    Arcsec,
    /// Radian.
    #[serde(rename = "rad")]
    Rad,
    /// Milliradian.
    #[serde(rename = "mrad")]
    Mrad,
    /// Microradian.
    #[serde(rename = "urad", alias = "µrad", alias = "μrad")]
    Urad,
    /// Second.
    #[serde(rename = "s")]
    Second,
    /// Millisecond.
    #[serde(rename = "ms")]
    Ms,
    /// Microsecond.
    #[serde(rename = "us", alias = "µs", alias = "μs")]
    Us,
    /// Nanosecond.
    #[serde(rename = "ns")]
    Ns,
    /// Minute.
    #[serde(rename = "min")]
    Min,
    /// Hour.
    #[serde(rename = "h")]
    Hour,
    /// Day.
    #[serde(rename = "d")]
    Day,
    /// Degree Celsius.
    #[serde(rename = "degC", alias = "degc", alias = "°C", alias = "C")]
    Degc,
    /// Degree Fahrenheit.
    #[serde(rename = "degF", alias = "degf", alias = "°F", alias = "F")]
    Degf,
    /// Kelvin.
    #[serde(rename = "K", alias = "kelvin")]
    Kelvin,
}

/// What a unit is one of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Length,
    Angle,
    Time,
    Temperature,
}

impl Kind {
    /// Names of its units, as a map takes them.
    pub fn units(self) -> String {
        let own = Unit::ALL.into_iter().filter(|unit| unit.kind() == self);
        own.map(Unit::name).collect::<Vec<_>>().join(", ")
    }
}

/// 0 degC in K, and in degF with the size of a kelvin in it.
const ZERO_K: f64 = 273.15;
const ZERO_DEGF: f64 = 32.0;
const DEGF_PER_K: f64 = 1.8;
const PER_RAD: f64 = 180.0 / std::f64::consts::PI;

impl Unit {
    /// Every unit.
    pub const ALL: [Self; 26] = [
        Self::Nm,
        Self::Um,
        Self::Mm,
        Self::Cm,
        Self::Metre,
        Self::Inch,
        Self::Thou,
        Self::Uin,
        Self::Deg,
        Self::Gon,
        Self::Turn,
        Self::Arcmin,
        Self::Arcsec,
        Self::Rad,
        Self::Mrad,
        Self::Urad,
        Self::Second,
        Self::Ms,
        Self::Us,
        Self::Ns,
        Self::Min,
        Self::Hour,
        Self::Day,
        Self::Degc,
        Self::Degf,
        Self::Kelvin,
    ];

    /// What it is one of.
    pub const fn kind(self) -> Kind {
        match self {
            Self::Nm
            | Self::Um
            | Self::Mm
            | Self::Cm
            | Self::Metre
            | Self::Inch
            | Self::Thou
            | Self::Uin => Kind::Length,
            Self::Degc | Self::Degf | Self::Kelvin => Kind::Temperature,
            Self::Deg
            | Self::Gon
            | Self::Turn
            | Self::Arcmin
            | Self::Arcsec
            | Self::Rad
            | Self::Mrad
            | Self::Urad => Kind::Angle,
            Self::Second | Self::Ms | Self::Us | Self::Ns | Self::Min | Self::Hour | Self::Day => {
                Kind::Time
            }
        }
    }

    /// One of it in mm, deg, s or K.
    pub const fn size(self) -> f64 {
        match self {
            Self::Nm => 1e-6,
            Self::Um | Self::Ms => 1e-3,
            Self::Mm | Self::Deg | Self::Second | Self::Degc | Self::Kelvin => 1.0,
            Self::Cm => 10.0,
            Self::Metre => 1e3,
            Self::Inch => 25.4,
            Self::Thou => 25.4e-3,
            Self::Uin => 25.4e-6,
            Self::Degf => 1.0 / DEGF_PER_K,
            Self::Gon => 0.9,
            Self::Turn => 360.0,
            Self::Arcmin => 1.0 / 60.0,
            Self::Arcsec => 1.0 / 3600.0,
            Self::Rad => PER_RAD,
            Self::Mrad => 1e-3 * PER_RAD,
            Self::Urad => 1e-6 * PER_RAD,
            Self::Us => 1e-6,
            Self::Ns => 1e-9,
            Self::Min => 60.0,
            Self::Hour => 3600.0,
            Self::Day => 86_400.0,
        }
    }

    /// `number` of this unit in another one of the same kind.
    pub fn convert(self, number: f64, to: Self) -> f64 {
        if self.kind() == Kind::Temperature {
            return to.of_degc(self.degc(number));
        }
        let (size, wanted) = (self.size(), to.size());
        if size < wanted {
            // 3.5 µm in mm and back are 3.5 µm: the quotient of sizes is whole or nearly so.
            number / (wanted / size)
        } else {
            number * (size / wanted)
        }
    }

    fn degc(self, number: f64) -> f64 {
        match self {
            Self::Degf => (number - ZERO_DEGF) / DEGF_PER_K,
            Self::Kelvin => number - ZERO_K,
            _ => number,
        }
    }

    fn of_degc(self, degc: f64) -> f64 {
        match self {
            Self::Degf => degc * DEGF_PER_K + ZERO_DEGF,
            Self::Kelvin => degc + ZERO_K,
            _ => degc,
        }
    }

    /// As a map names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nm => "nm",
            Self::Um => "um",
            Self::Mm => "mm",
            Self::Cm => "cm",
            Self::Metre => "m",
            Self::Inch => "inch",
            Self::Thou => "thou",
            Self::Uin => "uin",
            Self::Deg => "deg",
            Self::Gon => "gon",
            Self::Turn => "turn",
            Self::Arcmin => "arcmin",
            Self::Arcsec => "arcsec",
            Self::Rad => "rad",
            Self::Mrad => "mrad",
            Self::Urad => "urad",
            Self::Second => "s",
            Self::Ms => "ms",
            Self::Us => "us",
            Self::Ns => "ns",
            Self::Min => "min",
            Self::Hour => "h",
            Self::Day => "d",
            Self::Degc => "degC",
            Self::Degf => "degF",
            Self::Kelvin => "K",
        }
    }

    /// The unit that a word of a table's head names, in the spellings of the trade.
    pub fn of_word(word: &str) -> Option<Self> {
        let word = word.trim().trim_end_matches('.').replace(['µ', 'μ'], "u");
        let word = word.to_lowercase();
        let own = Self::ALL.into_iter().find(|unit| unit.name() == word);
        own.or(match word.as_str() {
            "micron" | "microns" | "micrometer" | "micrometre" | "mue" | "micrometers"
            | "micrometres" | "mikrometer" | "mikron" | "mikrons" => Some(Self::Um),
            "millimeter" | "millimetre" | "millimeters" | "millimetres" => Some(Self::Mm),
            "meter" | "metre" | "meters" | "metres" => Some(Self::Metre),
            "centimeter" | "centimetre" | "centimeters" | "centimetres" => Some(Self::Cm),
            "nanometer" | "nanometre" | "nanometers" | "nanometres" => Some(Self::Nm),
            "in" | "inches" | "zoll" => Some(Self::Inch),
            "uinch" | "microinch" | "microinches" => Some(Self::Uin),
            "°c" | "ºc" | "degc" | "celsius" => Some(Self::Degc),
            "°f" | "ºf" | "degf" | "fahrenheit" => Some(Self::Degf),
            "°k" | "degk" | "kelvin" => Some(Self::Kelvin),
            "°" | "degree" | "degrees" | "grad" => Some(Self::Deg),
            "gons" | "gradian" | "gradians" => Some(Self::Gon),
            "turns" | "rev" => Some(Self::Turn),
            "radian" | "radians" => Some(Self::Rad),
            "milliradian" | "milliradians" => Some(Self::Mrad),
            "microradian" | "microradians" => Some(Self::Urad),
            "'" | "′" | "arcminute" | "arcminutes" | "arc-min" | "arc min" | "bogenminute"
            | "bogenminuten" => Some(Self::Arcmin),
            "\"" | "″" | "arcsecond" | "arcseconds" | "arcs" | "as" | "asec" | "arc-sec"
            | "arc sec" | "bogensekunde" | "bogensekunden" => Some(Self::Arcsec),
            "sek" | "sekunde" | "sekunden" | "sec" | "secs" | "second" | "seconds" => {
                Some(Self::Second)
            }
            "msec" => Some(Self::Ms),
            "minutes" | "minute" => Some(Self::Min),
            "hour" | "hours" | "hr" | "hrs" | "std" | "stunden" => Some(Self::Hour),
            "day" | "days" | "tag" | "tage" => Some(Self::Day),
            "mins" | "minuten" => Some(Self::Min),
            "millisecond" | "milliseconds" => Some(Self::Ms),
            "microsecond" | "microseconds" => Some(Self::Us),
            "nanosecond" | "nanoseconds" => Some(Self::Ns),
            _ => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Unit;

    /// What two numbers differ by, as a share of the second.
    fn off(found: f64, wanted: f64) -> f64 {
        (found / wanted - 1.0).abs()
    }

    /// Whether a word is taken for a unit.
    fn is_taken(word: &str, unit: Option<Unit>) -> bool {
        Unit::of_word(word) == unit
    }

    #[test]
    fn a_unit_is_converted_as_tables_of_units_have_it() {
        // 1 inch = 25.4 mm, 1 rad = 206,264.806 arcsec (NIST SP 811, B.8), 1 deg = 3600 arcsec.
        for (number, from, to, wanted) in [
            (2.0, Unit::Inch, Unit::Mm, 50.8),
            (0.0001, Unit::Inch, Unit::Um, 2.54),
            (0.0035, Unit::Mm, Unit::Um, 3.5),
            (0.25, Unit::Metre, Unit::Mm, 250.0),
            (1.0, Unit::Rad, Unit::Arcsec, 206_264.806_247_096),
            (0.5, Unit::Deg, Unit::Arcsec, 1800.0),
            (250.0, Unit::Uin, Unit::Um, 6.35),
            (0.5, Unit::Thou, Unit::Um, 12.7),
            (2.5, Unit::Cm, Unit::Mm, 25.0),
            (68.0, Unit::Degf, Unit::Degc, 20.0),
            (293.15, Unit::Kelvin, Unit::Degc, 20.0),
            (-40.0, Unit::Degf, Unit::Degc, -40.0),
            (100.0, Unit::Gon, Unit::Deg, 90.0),
            (0.25, Unit::Turn, Unit::Deg, 90.0),
            (10.0, Unit::Urad, Unit::Arcsec, 2.062_648_062_47),
            (90.0, Unit::Min, Unit::Second, 5400.0),
            (
                1_767_600_000_250.0,
                Unit::Ms,
                Unit::Second,
                1_767_600_000.25,
            ),
        ] {
            let found = from.convert(number, to);
            assert!(off(found, wanted) < 1e-12, "{found} {wanted}");
            assert_eq!(from.kind(), to.kind());
        }
    }

    #[test]
    fn spellings_of_the_trade_are_known_and_others_are_not() {
        for (word, unit) in [
            ("µm", Unit::Um),
            ("μm", Unit::Um),
            ("um", Unit::Um),
            ("Microns", Unit::Um),
            ("MM", Unit::Mm),
            ("in", Unit::Inch),
            ("arcsec", Unit::Arcsec),
            ("″", Unit::Arcsec),
            ("°", Unit::Deg),
            ("sec.", Unit::Second),
        ] {
            assert!(is_taken(word, Some(unit)), "{word}");
        }
        for word in ["", "target", "um/m", "C", "mil", "K", "F"] {
            assert!(is_taken(word, None), "{word}");
        }
    }
}
