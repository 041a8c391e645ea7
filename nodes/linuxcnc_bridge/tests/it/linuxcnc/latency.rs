//! Touches at five feeds against a delay that only the HAL file holds.

use metrology::Axis;
use test_namespaces::isolated;

use crate::linuxcnc::rig::{Rig, read, scenario};

const PERIOD_S: f64 = 1e-3;
/// Ball centre at contact with the X face of block_1: corner -220 mm, ball 3 mm.
const CONTACT_MM: f64 = -223.0;
const FEEDS_MM_S: [f64; 5] = [2.0, 5.0, 10.0, 20.0, 30.0];
const REPEATS: u32 = 8;

/// Stand-offs are shifted so that the repeats of a feed spread over the phases of the servo period.
fn program(log: &str) -> String {
    let mut text = format!("G21 G90\nG0 Z60\nG0 X-240 Y-140\nG0 Z0\n(PROBEOPEN {log})\n");
    text.push_str("(feature: block_1/x)\n");
    for feed_mm_s in FEEDS_MM_S {
        for repeat in 0..REPEATS {
            let shift_mm = feed_mm_s * PERIOD_S * f64::from(repeat) / f64::from(REPEATS);
            let start_mm = CONTACT_MM - 3.0 - shift_mm;
            let feed_mm_min = feed_mm_s * 60.0;
            text.push_str(&format!(
                "G1 X{start_mm:.6} F1200\nG4 P0.3\nG38.2 X-218 F{feed_mm_min:.3}\n"
            ));
        }
    }
    text.push_str("(PROBECLOSE)\nG0 X-240\nM2\n");
    text
}

/// Slope and intercept of y over x, weighted by 1/x² (the scatter of a
/// polled latch is proportional to feed).
pub fn weighted_line(points: &[(f64, f64)]) -> (f64, f64) {
    let (mut s, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in points {
        let w = 1.0 / (x * x);
        s += w;
        sx += w * x;
        sy += w * y;
        sxx += w * x * x;
        sxy += w * x * y;
    }
    let slope = (s * sxy - sx * sy) / (s * sxx - sx * sx);
    (slope, (sy - slope * sx) / s)
}

pub fn on_delay_s() -> f64 {
    let hal = read(&scenario("linuxcnc_latency").join("controller/latency.hal"));
    let line = hal
        .lines()
        .find(|line| line.starts_with("setp probe-latency.on-delay "))
        .unwrap();
    line.split_whitespace().last().unwrap().parse().unwrap()
}

#[test]
fn touches_at_five_feeds_give_the_delay_that_only_hal_holds() {
    isolated(|| {
        let Some(mut rig) = Rig::new("linuxcnc_latency") else {
            return;
        };
        let log = rig.controller.as_ref().unwrap().folder().join("probed.txt");
        rig.touch(&program(&log.display().to_string()));
        assert_eq!(rig.triggers.len(), FEEDS_MM_S.len() * REPEATS as usize);

        // The controller's own probed positions are the ones that were published.
        let own: Vec<f64> = read(&log)
            .lines()
            .map(|line| line.split_whitespace().next().unwrap().parse().unwrap())
            .collect();
        assert_eq!(own.len(), rig.triggers.len());
        for (own_mm, trigger) in own.iter().zip(&rig.triggers) {
            assert!(
                (own_mm - trigger.latched[Axis::X]).abs() < 2e-6,
                "{own_mm} {trigger:?}"
            );
            assert_eq!(trigger.feature_id, "block_1/x");
            assert!((trigger.approach.x - 1.0).abs() < 1e-9);
        }
        let points: Vec<(f64, f64)> = rig
            .triggers
            .iter()
            .map(|t| (t.feed_mm_s, t.latched[Axis::X]))
            .collect();
        for (touches, feed_mm_s) in points.chunks(REPEATS as usize).zip(FEEDS_MM_S) {
            let waits_ms: Vec<f64> = touches
                .iter()
                .map(|(f, x)| (x - CONTACT_MM) / f * 1000.0)
                .collect();
            println!("{feed_mm_s} mm/s: waits {waits_ms:.3?} ms");
            assert!(
                touches
                    .iter()
                    .all(|(feed, _)| (feed - feed_mm_s).abs() < 0.01 * feed_mm_s)
            );
        }
        let (latency_s, surface_mm) = weighted_line(&points);
        let delay_s = on_delay_s();
        let expected_s = ((delay_s / PERIOD_S).ceil() - 1.0) * PERIOD_S + 0.5 * PERIOD_S;
        println!(
            "latency {:.4} ms, in HAL {:.4} ms, with the period's share (3) {:.4} ms, surface {surface_mm:.6} mm",
            latency_s * 1e3,
            delay_s * 1e3,
            expected_s * 1e3
        );
        assert!((latency_s - expected_s).abs() < 0.1e-3);
        assert!((latency_s - delay_s).abs() < 0.1e-3 + 0.5 * PERIOD_S);
        assert!((surface_mm - CONTACT_MM).abs() < 1e-3);
        check_stream(&rig);
    });
}

fn check_stream(rig: &Rig) {
    let mut missing = 0;
    for pair in rig.states.windows(2) {
        let step = (pair[1].controller_at - pair[0].controller_at).nanos();
        assert!(step > 0 && step % 1_000_000 == 0, "{step} ns");
        missing += step / 1_000_000 - 1;
    }
    let mut lags_ms: Vec<f64> = rig
        .states
        .iter()
        .map(|state| (state.received_at.nanos() - state.controller_at.nanos()) as f64 * 1e-6)
        .collect();
    lags_ms.sort_by(f64::total_cmp);
    let at = |share: f64| lags_ms[((lags_ms.len() - 1) as f64 * share) as usize] - lags_ms[0];
    println!(
        "records come later than the fastest by: median {:.1} ms, 99 % {:.1} ms, greatest {:.1} ms",
        at(0.5),
        at(0.99),
        at(1.0)
    );
    println!(
        "{} records, {missing} missing; {:?}",
        rig.states.len(),
        rig.conditions
    );
    assert_eq!(missing, 0);
}
