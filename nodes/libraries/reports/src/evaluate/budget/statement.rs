//! Instruments of a budget file, as a report names them.

use schemars::JsonSchema;
use serde::Deserialize;

/// What a page has where nothing is stated.
pub const NOT_STATED: &str = "not stated";
/// Longest text, bytes.
const MAX_TEXT_BYTES: usize = 200;

/// An instrument and its certificate.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Instrument {
    /// Maker and type.
    #[serde(default)]
    pub instrument: Option<String>,
    /// Serial number.
    #[serde(default)]
    pub serial_number: Option<String>,
    /// Number and date of its certificate.
    #[serde(default)]
    pub certificate: Option<String>,
}

/// The instruments that a bag may have readings of.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Instruments {
    /// Interferometer, tracker or step gauge.
    #[serde(default)]
    pub length_reference: Instrument,
    /// Encoder, autocollimator with polygon, or indexing table.
    #[serde(default)]
    pub angular_reference: Instrument,
    /// Ballbar.
    #[serde(default)]
    pub ballbar: Instrument,
    /// Plate and head.
    #[serde(default)]
    pub grid_encoder: Instrument,
    /// Touch probe.
    #[serde(default)]
    pub touch_probe: Instrument,
}

impl Instrument {
    const NONE: Self = Self {
        instrument: None,
        serial_number: None,
        certificate: None,
    };

    /// Its texts by key.
    pub fn texts(&self) -> [(&'static str, Option<&str>); 3] {
        [
            ("instrument", self.instrument.as_deref()),
            ("serial_number", self.serial_number.as_deref()),
            ("certificate", self.certificate.as_deref()),
        ]
    }
}

impl Instruments {
    /// None is stated.
    pub const NONE: Self = Self {
        length_reference: Instrument::NONE,
        angular_reference: Instrument::NONE,
        ballbar: Instrument::NONE,
        grid_encoder: Instrument::NONE,
        touch_probe: Instrument::NONE,
    };

    /// All texts by their keys in the file.
    pub(super) fn texts(&self) -> Vec<(String, Option<&str>)> {
        let all = [
            ("length_reference", &self.length_reference),
            ("angular_reference", &self.angular_reference),
            ("ballbar", &self.ballbar),
            ("grid_encoder", &self.grid_encoder),
            ("touch_probe", &self.touch_probe),
        ];
        let of = |(name, one): (&str, &'_ Instrument)| -> Vec<String> {
            let keys = one.texts().map(|(key, _)| key);
            keys.map(|key| format!("instruments.{name}.{key}")).to_vec()
        };
        let keys = all.into_iter().flat_map(of);
        let texts = all
            .into_iter()
            .flat_map(|(_, one)| one.texts().map(|(_, text)| text));
        keys.zip(texts).collect()
    }
}

/// Refuses a text that is empty, long, or of more than one line; the message.
pub(super) fn check(key: &str, text: &str) -> Result<(), String> {
    if text.trim().is_empty() {
        return Err(format!("{key} is empty: leave it out or state it"));
    }
    if text.chars().any(char::is_control) {
        return Err(format!("{key} has a control character: must be one line"));
    }
    if text.len() > MAX_TEXT_BYTES {
        let n = text.len();
        return Err(format!("{key} has {n} bytes: at most {MAX_TEXT_BYTES}"));
    }
    Ok(())
}

/// Least coefficient of expansion of a body but zero, µm/(m K): that of glass ceramics.
const LEAST_EXPANSION_UM_PER_M_K: f64 = 0.02;

/// What is wrong with a coefficient of expansion that no body has: one per K or in mm is a million or a thousand times less.
pub(super) fn unit_slip(expansion_um_per_m_k: f64) -> Option<String> {
    let is_slip = expansion_um_per_m_k > 0.0 && expansion_um_per_m_k < LEAST_EXPANSION_UM_PER_M_K;
    is_slip.then(|| {
        format!(
            " = {}: must be 0, or from {LEAST_EXPANSION_UM_PER_M_K} um/(m K) on: 11e-6 per K are 11.0",
            metrology::number::number(expansion_um_per_m_k)
        )
    })
}
