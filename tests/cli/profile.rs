//! Tests of `tallow profile`: what it prints and writes, and how profiles are compared.
use crate::command::{complains, stdout, tallow};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

const BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
const SMALL: [&str; 8] = ["--width", "24", "--height", "16", "--spp", "2", "--frames", "4"];

fn profile(folder: &TempDir, more: &[&str]) -> Value {
    let output = tallow(folder, &[&["profile", BOX, "--validation", "--json"], &SMALL[..], more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&stdout(&output)).unwrap()
}

fn write(folder: &TempDir, name: &str, profile: &Value) {
    std::fs::write(folder.path().join(name), profile.to_string()).unwrap();
}

/// A profile whose clocks are as steady as no machine's are, so that verdicts do not depend on this one.
fn steady(mut profile: Value) -> Value {
    profile["arithmetic_gop_s_after"] = profile["ceilings"]["arithmetic_gop_s"].clone();
    profile
}

#[test]
fn passes_have_times_work_and_limits() {
    let folder = tempfile::tempdir().unwrap();
    let json = profile(&folder, &["--denoise", "atrous", "--csv", "times.csv"]);
    let passes = json["passes"].as_array().unwrap();
    let find = |name: &str| passes.iter().find(|p| p["pass"] == name).unwrap_or_else(|| panic!("{name}: {json}"));
    let frame = json["frame_ms"]["median"].as_f64().unwrap();
    for pass in passes {
        let [least, median, most] = ["min", "median", "max"].map(|name| pass["ms"][name].as_f64().unwrap());
        assert!(least <= median && median <= most, "{pass}");
        assert!((pass["share"].as_f64().unwrap() * frame - median).abs() < 1e-6 * frame, "{pass}");
        assert!(pass["ms"]["samples"].as_array().unwrap().len() == 4 && pass["ms"]["p95"].is_null(), "{pass}");
    }
    // Two samples of 384 pixels, three records of 16 bytes each; the rest is nodes of 80 bytes.
    let count = |name: &str, what: &str| find(name)["work"][what]["count"].as_u64().unwrap();
    let nodes = json["counters"]["nodes"].as_u64().unwrap();
    assert_eq!(count("path", "bytes"), 768 * 48 + 80 * nodes);
    assert_eq!(find("path")["work"]["threads"], 768);
    assert_eq!(find("path")["work"]["bytes"]["is_least"], true);
    assert!(json["counters"]["closest"].as_u64().unwrap() >= 768 && json["mrays_s"].as_f64().unwrap() > 0.0);
    // Five levels, each of which reads colours and places and writes colours, of 16 bytes.
    assert_eq!(count("atrous", "bytes"), 5 * 384 * 48);
    assert_eq!(
        (&find("atrous")["work"]["calls"], &find("atrous")["work"]["bytes"]["is_least"]),
        (&5.into(), &false.into())
    );
    assert!(count("atrous", "operations") > 5 * 384 * 25, "more than one a tap: {}", find("atrous"));
    let copies = json["ceilings"]["copies"].as_array().unwrap();
    assert!(copies.len() > 2 && copies.iter().all(|copy| copy["gb_s"].as_f64().unwrap() > 0.0), "{json}");
    assert!(json["overhead"]["timed_ms"]["median"].as_f64().unwrap() > 0.0);
    let csv = std::fs::read_to_string(folder.path().join("times.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 4 * (passes.len() + 1));
    assert!(csv.starts_with("frame,pass,milliseconds\n0,update,") && csv.contains("\n3,frame,"), "{csv}");
}

#[test]
fn the_trace_is_what_perfetto_reads() {
    let folder = tempfile::tempdir().unwrap();
    let json = profile(&folder, &["--trace", "trace.json"]);
    let calls = |pass: &Value| pass["work"]["calls"].as_u64().unwrap();
    let passes: u64 = json["passes"].as_array().unwrap().iter().map(calls).sum();
    check_trace(&folder.path().join("trace.json"), 4 * passes);
}

/// What Perfetto's reader of Chrome traces asks for: a phase of every event, process, thread and time as numbers; names; of spans a
/// duration; and on each thread spans that do not overlap once times are cut to whole nanoseconds.
fn check_trace(path: &Path, gpu_spans: u64) {
    let trace: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let events = trace["traceEvents"].as_array().unwrap();
    let mut threads: BTreeMap<u64, Vec<[i64; 2]>> = BTreeMap::new();
    let mut named = Vec::new();
    for event in events {
        let thread = event["tid"].as_u64().unwrap();
        assert!(event["pid"].is_u64() && event["name"].is_string(), "{event}");
        match event["ph"].as_str().unwrap() {
            "M" => named.extend(event["args"]["name"].as_str().map(|_| thread)),
            "X" => {
                let ns = |key: &str| (event[key].as_f64().unwrap_or_else(|| panic!("{event}")) * 1e3) as i64;
                threads.entry(thread).or_default().push([ns("ts"), ns("dur")]);
            }
            other => panic!("a phase that is not written: {other}"),
        }
    }
    for (thread, spans) in &threads {
        assert!(named.contains(thread), "thread {thread} has a name");
        assert!(spans.iter().all(|[begin, duration]| *begin >= 0 && *duration >= 0));
        assert!(
            spans.windows(2).all(|pair| pair[0][0] + pair[0][1] <= pair[1][0]),
            "thread {thread} overlaps or is out of order"
        );
    }
    assert_eq!(
        threads.values().map(|spans| spans.len() as u64).max(),
        Some(gpu_spans),
        "every pass of every timed frame"
    );
    assert_eq!(threads.values().map(Vec::len).min(), Some(8), "four frames with and four without timestamps");
    let offset_known = !trace.to_string().contains("unknown");
    assert_eq!(offset_known, trace["otherData"]["clockDeviationMicroseconds"].is_number());
}

#[test]
fn a_profile_is_the_same_as_itself_and_a_slower_one_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let old = steady(profile(&folder, &["--denoise", "none"]));
    assert_eq!(old["denoise"], Value::Null, "no filter that a render would not run");
    write(&folder, "old.json", &old);
    let same = tallow(&folder, &["profile", "old.json", "--compare", "old.json", "--quiet"]);
    assert_eq!(
        (same.status.code(), stdout(&same).as_str()),
        (Some(0), "same: nothing changed by more than its noise\n")
    );
    let mut slow = old.clone();
    let path = slow["passes"].as_array_mut().unwrap().iter_mut().find(|p| p["pass"] == "path").unwrap();
    path["ms"]["median"] = (path["ms"]["median"].as_f64().unwrap() + 10_000.0).into();
    write(&folder, "slow.json", &slow);
    let slower = tallow(&folder, &["profile", "slow.json", "--compare", "old.json"]);
    assert_eq!(slower.status.code(), Some(1));
    let last = stdout(&slower).lines().last().unwrap().to_owned();
    assert_eq!(last, "changed: path slower by 10000.000 ms");
    let faster = tallow(&folder, &["profile", "old.json", "--compare", "slow.json", "--json"]);
    let json: Value = serde_json::from_str(&stdout(&faster)).unwrap();
    assert_eq!((faster.status.code(), &json["comparison"]["verdict"]), (Some(1), &"changed".into()));
    let mut other = old.clone();
    other["host"]["device"] = "another".into();
    write(&folder, "other.json", &other);
    let unknown = tallow(&folder, &["profile", "other.json", "--compare", "old.json", "--quiet"]);
    assert_eq!(unknown.status.code(), Some(7));
    assert!(stdout(&unknown).starts_with("inconclusive: devices differ"), "{}", stdout(&unknown));
}

/// They need a device first, and there is none of this name.
#[test]
fn a_profile_of_something_else_is_told_before_frames_run() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "old.json", &profile(&folder, &[]));
    let none = ["profile", BOX, "--compare", "old.json", "--device", "nobody", "--height", "16", "--spp", "2"];
    let run = |words: &[&str]| tallow(&folder, &[&none, words].concat());
    complains(&run(&["--width", "4096"]), 2, &["the settings differ: width was 24, now 4096: profile both alike"]);
    complains(&run(&["--width", "24", "--denoise", "atrous"]), 2, &["filters differ: none and atrous"]);
    let other = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/moving/scene.toml");
    let mut words = none;
    words[1] = other;
    let settings = ["--width", "24", "--max-depth", "8"];
    let told = tallow(&folder, &[&words[..], &settings].concat());
    complains(&told, 2, &["another scene"]);
}

#[test]
fn an_earlier_profile_takes_no_options_of_a_render() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "old.json", &steady(profile(&folder, &[])));
    let run = |words: &[&str]| tallow(&folder, &[&["profile", "old.json", "--compare", "old.json"], words].concat());
    for words in [
        &["--spp", "8"][..],
        &["--spp", "64"],
        &["--allocate", "uniform"],
        &["--frames", "20"],
        &["--denoise", "atrous"],
        &["--device", "0"],
        &["--tracing", "auto"],
        &["--validation"],
    ] {
        complains(&run(words), 2, &["old.json", "leave out"]);
    }
    assert_eq!(run(&["--csv", "a.csv", "--json"]).status.code(), Some(0), "control");
}

#[test]
fn bad_profiles_and_options_are_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| tallow(&folder, &[&["profile"], words].concat());
    std::fs::write(folder.path().join("half.json"), "{\"schema\": 1, \"scene\":").unwrap();
    std::fs::write(folder.path().join("newer.json"), "{\"schema\": 2, \"what\": []}").unwrap();
    std::fs::write(folder.path().join("list.json"), "[1, 2]").unwrap();
    std::fs::write(folder.path().join("empty.json"), "{\"schema\": 1}").unwrap();
    complains(&run(&["half.json"]), 3, &["half.json: ends before it is complete: profile again"]);
    complains(&run(&[BOX, "--compare", "newer.json"]), 3, &["newer.json: is of version 2", "reads version 1: profile"]);
    complains(
        &run(&[BOX, "--compare", "list.json"]),
        3,
        &["list.json: is no profile, which tallow profile --json prints"],
    );
    complains(&run(&["empty.json"]), 3, &["empty.json: is damaged: missing field"]);
    complains(&run(&["missing.json"]), 3, &["missing.json", "No such file"]);
    complains(&run(&[BOX, "--compare", "missing.json"]), 3, &["missing.json", "No such file"]);
    complains(&run(&["missing.toml"]), 3, &["missing.toml"]);
    complains(&run(&[BOX, "--denoise", "oidn"]), 2, &["oidn", "passes"]);
    complains(&run(&[BOX, "--frames", "0"]), 2, &["--frames"]);
    complains(&run(&[BOX, "--csv", "a", "--trace", "a"]), 2, &["same file"]);
    complains(&run(&["half.json", "--csv", "half.json"]), 2, &["same file as the scene"]);
    complains(&run(&["empty.json", "--trace", "t.json"]), 2, &["--trace"]);
    complains(&run(&[BOX, "--csv", "nowhere/a.csv"]), 5, &["nowhere"]);
}

#[test]
fn help_says_what_is_special_about_profiles() {
    let help = stdout(&tallow(&TempDir::new().unwrap(), &["profile", "--help"]));
    for words in ["times mean little then", "--compare reads it", "with --compare, the verdict"] {
        assert!(help.contains(words), "{words}: {help}");
    }
}
