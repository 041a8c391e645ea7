//! Gap and noise floor by channel, and the vibrations that are part of the floor.

use gap_diagnosis::report::{GapReport, NoiseFloor, Vibration};

use super::{GAP, maybe, three};
use crate::section::{Section, rounded};

/// Gap and floor by channel, with the vibrations in the floor.
pub(super) fn section(report: &GapReport) -> Section {
    let rows = report.gap.per_channel.iter().map(|channel| {
        let noise = report
            .noise_floor
            .iter()
            .find(|n| n.channel == channel.channel);
        let of = |value: fn(&NoiseFloor) -> String| noise.map_or_else(|| "—".to_owned(), value);
        vec![
            channel.channel.clone(),
            three(channel.rms_um),
            three(channel.p95_um),
            three(channel.floor_um),
            if channel.above_floor { "yes" } else { "no" }.to_owned(),
            of(|n| three(n.sigma_um)),
            of(|n| maybe(n.between_runs_um)),
            of(|n| n.repeats.to_string()),
            of(|n| if n.reproduced { "yes" } else { "no" }.to_owned()),
        ]
    });
    let names = [
        "channel",
        "gap rms µm",
        "95 % µm",
        "floor µm",
        "above it",
        "noise of a reading µm",
        "between runs µm",
        "repeats",
        "reproduced",
    ];
    let mut section = super::section(
        GAP,
        &names,
        rows.collect(),
        "Above it: by more than noise and the error of form that every simulator is taken to have (0.2 µm). Rotary axes in mrad, thermometers in mK.",
    );
    section.lines = report.noise_floor.iter().flat_map(vibrations).collect();
    section
}

/// A sentence for each vibration in the noise of a channel.
fn vibrations(floor: &NoiseFloor) -> Vec<String> {
    let channel = in_words(&floor.channel);
    let sentence = |own: &Vibration| {
        let plane = match own.plane.as_str() {
            "" => String::new(),
            plane => format!(" in {plane}"),
        };
        format!(
            "Of the noise of {channel}{plane}, {} µm, {} µm rms is a vibration of {} in {}; it names no cause. {}",
            three(floor.sigma_um),
            three(own.rms_um),
            frequency(own),
            runs(own),
            could_be(own)
        )
    };
    floor.vibrations.iter().map(sentence).collect()
}

/// A channel as people call it.
fn in_words(channel: &str) -> String {
    match channel {
        "grid.u" | "grid.v" => format!("the grid encoder's coordinate {}", &channel[5..]),
        "radial" => "the radial readings".to_owned(),
        _ => channel.to_owned(),
    }
}

fn frequency(own: &Vibration) -> String {
    let (value, half) = rounded(own.frequency_hz, own.frequency_half_width_hz);
    format!("{value} Hz (± {half})")
}

fn runs(own: &Vibration) -> String {
    if own.runs == own.of {
        format!("all {} runs", own.of)
    } else {
        format!("{} of {} runs", own.runs, own.of)
    }
}

/// What looks the same to such a sampling.
fn could_be(own: &Vibration) -> String {
    let [rate, hz] = [own.sampled_hz, own.frequency_hz];
    let alias = format!(
        "Sampled {} times a second, it looks like its aliases: {} Hz, {} Hz and so on",
        three(rate),
        three(rate - hz),
        three(rate + hz)
    );
    match own.period_mm {
        Some(mm) => format!(
            "{alias}; at the one feed of these runs an error with a period of {} mm does too.",
            three(mm)
        ),
        None => format!("{alias}."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vibration_has_its_runs_and_its_aliases() {
        let floor = NoiseFloor {
            channel: "radial".to_owned(),
            sigma_um: 0.34,
            ar: vec![],
            between_runs_um: None,
            repeats: 3,
            reproduced: true,
            vibrations: vec![Vibration {
                plane: "XY".to_owned(),
                frequency_hz: 47.31,
                frequency_half_width_hz: 0.21,
                rms_um: 0.21,
                runs: 12,
                of: 12,
                sampled_hz: 250.0,
                period_mm: Some(0.352),
                chance: 1e-9,
            }],
        };
        let [sentence] = &vibrations(&floor)[..] else {
            panic!("one sentence")
        };
        assert_eq!(
            sentence,
            "Of the noise of the radial readings in XY, 0.340 µm, 0.210 µm rms is a vibration of 47.31 Hz (± 0.21) in all 12 runs; \
             it names no cause. Sampled 250 times a second, it looks like its aliases: 203 Hz, 297 Hz and so on; at the one \
             feed of these runs an error with a period of 0.352 mm does too."
        );
    }
}
