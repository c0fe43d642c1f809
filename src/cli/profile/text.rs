//! A profile as text tables and as lines of numbers.
use crate::cli::readable;
use crate::profile::ceilings::CopySpeed;
use crate::profile::{Change, Comparison, Limit, PassProfile, Profile, Spread, Verdict, work::Amount};
use crate::report::table::{self, milliseconds};
use std::fmt::Write;

/// Tables for people.
pub fn of_profile(p: &Profile) -> String {
    let settings = &p.settings;
    let filter = p.denoise.as_deref().map(|name| format!(", filtered by {name}")).unwrap_or_default();
    let frames = p.frame_ms.samples.len();
    let mut text = format!(
        "{}: {} x {}, {} spp{filter}, {frames} frames on {} ({}; {})\n\n",
        readable(&p.scene),
        settings.width,
        settings.height,
        settings.spp,
        p.host.device,
        p.host.driver,
        p.host.cpu
    );
    let total = vec!["-".to_owned(); 8];
    let rows = p.passes.iter().map(cells).chain([[times("frame", &p.frame_ms, 1.0), total].concat()]);
    let header = [
        "pass",
        "median ms",
        "min",
        "max",
        "p95",
        "share",
        "workgroups",
        "MB",
        "GB/s",
        "of copy",
        "Mop",
        "Gop/s",
        "of arithmetic",
        "nearer to",
    ];
    text += &table::text(&header, &rows.collect::<Vec<_>>());
    text + &below(p)
}

/// What is said below the table.
fn below(p: &Profile) -> String {
    let (ceilings, counters, overhead) = (&p.ceilings, &p.counters, &p.overhead);
    let per_ray = counters.nodes as f64 / counters.rays().max(1) as f64;
    let share = 100.0 * overhead.cost_ms / overhead.untimed_ms.median.max(1e-9);
    let copy = |copy: &CopySpeed| format!("{:.1} GB/s of {} MiB", copy.gb_s, copy.bytes >> 20);
    let copies: Vec<_> = ceilings.copies.iter().map(copy).collect();
    let clocks = match p.timer.calibration_deviation_ns {
        Some(ns) => format!("clocks of device and host tied within {:.3} us", ns as f64 * 1e-3),
        None => "clocks of device and host not tied".to_owned(),
    };
    let mhz =
        p.device_mhz.map(|[before, after]| format!("device at {before} MHz before and {after} after the frames\n"));
    let mhz = mhz.unwrap_or_default();
    format!(
        "\nrays: {} per frame, {:.2} Mrays/s, {per_ray:.1} nodes each\n\
         ceilings: copy {}; arithmetic {:.1} Gop/s before and {:.1} after the frames\n\
         timestamps cost {} ms of a frame of {} ms ({share:.1} %); steps of {} ns; {clocks}\n{mhz}",
        counters.rays(),
        p.mrays_s,
        copies.join(", "),
        ceilings.arithmetic_gop_s,
        p.arithmetic_gop_s_after,
        milliseconds(overhead.cost_ms),
        milliseconds(overhead.untimed_ms.median),
        p.timer.quantum_ns,
    )
}

fn times(name: &str, ms: &Spread, share: f64) -> Vec<String> {
    let p95 = ms.p95.map_or_else(|| "-".to_owned(), milliseconds);
    let [median, min, max] = [ms.median, ms.min, ms.max].map(milliseconds);
    vec![name.to_owned(), median, min, max, p95, format!("{:.1} %", 100.0 * share)]
}

fn cells(p: &PassProfile) -> Vec<String> {
    let amount =
        |amount: &Amount| format!("{:.2}{}", amount.count as f64 * 1e-6, if amount.is_least { "+" } else { "" });
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let limit = match p.limit {
        Limit::Memory => "memory",
        Limit::Arithmetic => "arithmetic",
        Limit::Neither => "neither",
    };
    let work = vec![
        p.work.workgroups.to_string(),
        amount(&p.work.bytes),
        format!("{:.2}", p.gb_s),
        percent(p.memory_share),
        amount(&p.work.operations),
        format!("{:.2}", p.gop_s),
        percent(p.arithmetic_share),
        limit.to_owned(),
    ];
    [times(&p.pass, &p.ms, p.share), work].concat()
}

/// What changed, and the verdict; the verdict alone where `briefly`.
pub fn of_comparison(found: &Comparison, briefly: bool) -> String {
    let mut text = String::new();
    if !briefly {
        let ms = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), milliseconds);
        let row = |row: &crate::profile::Row| {
            let by = row.old_ms.zip(row.new_ms).map(|(old, new)| new - old);
            vec![
                row.pass.clone(),
                ms(row.old_ms),
                ms(row.new_ms),
                ms(by),
                ms(row.threshold_ms),
                word(row.change).to_owned(),
            ]
        };
        let header = ["pass", "old ms", "new ms", "by", "counts above", ""];
        text = format!("\n{}\n", table::text(&header, &found.rows.iter().map(row).collect::<Vec<_>>()));
    }
    let reasons = found.reasons.join("; ");
    match found.verdict {
        Verdict::Same => text + "same: nothing changed by more than its noise\n",
        Verdict::Changed => text + &format!("changed: {}\n", changes(found)),
        Verdict::Inconclusive => text + &format!("inconclusive: {}\n", readable(&reasons)),
    }
}

fn changes(found: &Comparison) -> String {
    let mut text = String::new();
    for row in found.rows.iter().filter(|row| row.change != Change::Same) {
        let comma = if text.is_empty() { "" } else { ", " };
        let _ = write!(text, "{comma}{} {}", row.pass, word(row.change));
        if let Some((old, new)) = row.old_ms.zip(row.new_ms) {
            let _ = write!(text, " by {} ms", milliseconds((new - old).abs()));
        }
    }
    text
}

fn word(change: Change) -> &'static str {
    match change {
        Change::Same => "same",
        Change::Slower => "slower",
        Change::Faster => "faster",
        Change::Added => "added",
        Change::Removed => "removed",
        Change::Unknown => "unknown",
    }
}

/// Milliseconds of every pass in every frame, and of the frame.
pub fn csv(p: &Profile) -> String {
    let mut text = String::from("frame,pass,milliseconds\n");
    let passes = p.passes.iter().map(|pass| (pass.pass.as_str(), &pass.ms)).chain([("frame", &p.frame_ms)]);
    for (name, ms) in passes {
        for (frame, ms) in ms.samples.iter().enumerate() {
            let _ = writeln!(text, "{frame},{name},{ms:.6}");
        }
    }
    text
}
