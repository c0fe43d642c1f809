//! Verdicts of made-up profiles.
use super::super::work::Work;
use super::super::{Ceilings, Host, Limit, Overhead, PassProfile, SCHEMA, Timer};
use super::*;
use crate::render::Counters;
use crate::render::settings::Settings;

fn pass(name: &str, samples: &[f64]) -> PassProfile {
    PassProfile {
        pass: name.to_owned(),
        ms: Spread::of(samples.to_vec()),
        share: 0.5,
        work: Work::default(),
        gb_s: 0.0,
        gop_s: 0.0,
        memory_share: 0.0,
        arithmetic_share: 0.0,
        limit: Limit::Neither,
    }
}

/// 20 frames of which the first run of four takes `wobble` longer.
fn frames(ms: f64, wobble: f64) -> Vec<f64> {
    (0..20).map(|i| if i < 4 { ms + wobble } else { ms }).collect()
}

fn profile(frame: &[f64], passes: Vec<PassProfile>) -> Profile {
    let text = || "x".to_owned();
    Profile {
        schema: SCHEMA,
        tallow: text(),
        scene: text(),
        scene_fingerprint: text(),
        settings: Settings::default(),
        denoise: None,
        host: Host { device: text(), driver: text(), cpu: text() },
        timer: Timer { period_ns: 1.0, quantum_ns: 1, calibration_deviation_ns: None },
        ceilings: Ceilings { copies: Vec::new(), arithmetic_gop_s: 100.0 },
        arithmetic_gop_s_after: 99.0,
        device_mhz: Some([1800, 1750]),
        frame_ms: Spread::of(frame.to_vec()),
        passes,
        counters: Counters::default(),
        mrays_s: 0.0,
        overhead: Overhead { timed_ms: Spread::default(), untimed_ms: Spread::default(), cost_ms: 0.0 },
    }
}

/// A frame of 10 ms, whose noise is `wobble`, and now `by` more.
fn changed(wobble: f64, by: f64) -> Comparison {
    let of = |ms| profile(&frames(ms, wobble), vec![pass("path", &frames(ms, wobble))]);
    Comparison::new(&of(10.0), &of(10.0 + by)).unwrap()
}

#[test]
fn a_profile_beside_itself_shows_no_change() {
    let found = changed(0.2, 0.0);
    assert_eq!((found.verdict, found.reasons.len(), found.rows.len()), (Verdict::Same, 0, 2));
    assert!(found.rows.iter().all(|row| row.change == Change::Same && row.old_ms == row.new_ms));
}

#[test]
fn a_change_must_exceed_the_largest_of_four() {
    // 0.5 % of 10 ms, and 0.05 ms, are the same.
    assert_eq!((changed(0.0, 0.04).verdict, changed(0.0, 0.06).verdict), (Verdict::Same, Verdict::Changed));
    // Three ranges of 0.2 ms.
    assert_eq!((changed(0.2, 0.59).verdict, changed(0.2, 0.61).verdict), (Verdict::Same, Verdict::Changed));
    let row = |by| changed(0.0, by).rows[1].change;
    assert_eq!((row(1.0), row(-1.0)), (Change::Slower, Change::Faster));
    let threshold = |frame_ms: f64, quantum_ns| {
        let mut old = profile(&[frame_ms; 4], Vec::new());
        old.timer.quantum_ns = quantum_ns;
        Comparison::new(&old, &old.clone()).unwrap().rows[0].threshold_ms.unwrap()
    };
    assert_eq!((threshold(1.0, 1), threshold(100.0, 1), threshold(1.0, 1_000_000)), (0.05, 0.5, 2.0));
}

#[test]
fn passes_that_come_and_go_are_changes() {
    let of = |name| profile(&frames(10.0, 0.0), vec![pass(name, &frames(10.0, 0.0))]);
    let found = Comparison::new(&of("old"), &of("new")).unwrap();
    let changes: Vec<_> = found.rows.iter().map(|row| (row.pass.as_str(), row.change)).collect();
    assert_eq!(changes, [("frame", Change::Same), ("new", Change::Added), ("old", Change::Removed)]);
    assert_eq!(found.verdict, Verdict::Changed);
}

#[test]
fn other_machines_clocks_and_too_few_frames_are_inconclusive() {
    let old = profile(&frames(10.0, 0.0), Vec::new());
    let beside = |change: &dyn Fn(&mut Profile)| {
        let mut new = old.clone();
        change(&mut new);
        Comparison::new(&old, &new).map(|found| (found.verdict, found.reasons.join("; ")))
    };
    let inconclusive = |change: &dyn Fn(&mut Profile), word: &str| {
        let (verdict, reasons) = beside(change).unwrap();
        assert!(verdict == Verdict::Inconclusive && reasons.contains(word), "{reasons}");
    };
    inconclusive(&|p| p.host.device = "other".into(), "devices differ: x and other");
    inconclusive(&|p| p.host.driver = "other".into(), "drivers differ");
    inconclusive(&|p| p.host.cpu = "other".into(), "processors differ");
    inconclusive(&|p| p.arithmetic_gop_s_after = 94.0, "clocks differ");
    inconclusive(&|p| p.device_mhz = Some([1800, 1600]), "clocks differ: 1600 to 1800 MHz");
    inconclusive(&|p| p.frame_ms = Spread::of(vec![10.0; 3]), "too few frames");
    assert_eq!(beside(&|p| p.arithmetic_gop_s_after = 96.0).unwrap().0, Verdict::Same);
    let refused = |change: &dyn Fn(&mut Profile), word: &str| {
        let line = beside(change).unwrap_err().to_string();
        assert!(line.contains(word) && !line.contains('\n'), "{line}");
    };
    refused(&|p| p.scene_fingerprint = "other".into(), "another scene");
    refused(&|p| p.settings.spp = 3, "settings differ");
    refused(&|p| p.denoise = Some("auto".into()), "filters differ: none and auto");
}
