//! Tests `tallow render --time`, `--error` and `--plan`.
use crate::command::{complains, stdout, tallow};
use serde_json::Value;
use std::path::Path;
use std::process::Output;
use tallow::image;
use tempfile::TempDir;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");

fn render(folder: &TempDir, scene: &str, words: &str) -> Output {
    let words: Vec<_> = ["render", scene].into_iter().chain(words.split_whitespace()).collect();
    tallow(folder, &words)
}

const SMALL: &str = "--width 33 --height 32 --max-depth 3";

#[test]
fn a_plan_is_rendered_and_rendered_again_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let first = render(&folder, SCENE, &format!("{SMALL} --error 0.02 --plan plan.json -o a.exr"));
    assert!(first.status.success(), "{first:?}");
    let text = stdout(&first);
    assert!(text.contains("planned for a relMSE of 0.02: ") && text.contains("rather than "), "{text}");
    assert!(text.contains(", and the probe before ") && text.ends_with("\nwritten: a.exr\n"), "{text}");
    let plan: Value = serde_json::from_slice(&std::fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    assert!(
        plan["chosen"]["relmse"].as_f64().unwrap() <= 0.0201 && plan["others"].as_array().unwrap().len() == 1,
        "{plan}"
    );
    assert!(plan["chosen"]["gpu_ms"].as_f64() <= plan["others"][0]["gpu_ms"].as_f64(), "the faster one: {plan}");
    let again = render(&folder, SCENE, "--plan plan.json -o b.exr --json");
    let json: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert!(json["plan"] == plan && json["gpu_ms"].as_f64().unwrap() > 0.0, "{json}");
    assert_eq!(json["samples"].as_u64().unwrap(), 33 * 32 * plan["chosen"]["spp"].as_u64().unwrap());
    let picture = |name: &str| image::read(&folder.path().join(name)).unwrap().picture(None).unwrap().pixels;
    assert!(picture("a.exr") == picture("b.exr"));
    // A time that is far from the planned one is told.
    let long = plan["chosen"]["gpu_ms"].as_f64().unwrap() * 1000.0;
    let mut slow = plan.clone();
    slow["chosen"]["gpu_ms"] = long.into();
    std::fs::write(folder.path().join("slow.json"), slow.to_string()).unwrap();
    let missed = stdout(&render(&folder, SCENE, "--plan slow.json -o b.exr"));
    assert!(missed.contains(&format!("where {long:.1} ms were planned")), "{missed}");
    assert!(!missed.contains("probe"), "nothing was probed: {missed}");
    // A scene whose own policy could not give the samples that a plan gives by another.
    let few = std::fs::read_to_string(SCENE).unwrap() + "\n[allocate]\nmax_spp = 4\n";
    let beside = Path::new(SCENE).parent().unwrap().display().to_string();
    let few = few.replace("file = \"", &format!("file = \"{beside}/"));
    std::fs::write(folder.path().join("few.toml"), few).unwrap();
    let kept = render(&folder, "few.toml", &format!("{SMALL} --allocate both --error 0.3 --plan few.json -o d.exr"));
    assert!(kept.status.success(), "{kept:?}");
    let followed = render(&folder, "few.toml", "--plan few.json -o e.exr");
    assert!(followed.status.success() && picture("d.exr") == picture("e.exr"), "{followed:?}");
    // Control: other samples are other bits.
    assert!(render(&folder, SCENE, &format!("{SMALL} --error 0.02 --seed 7 -o c.exr")).status.success());
    assert!(picture("a.exr") != picture("c.exr"));
}

#[test]
fn a_time_decides_the_samples_and_a_given_filter_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let plan = |words: &str| {
        let output = render(&folder, SCENE, &format!("{SMALL} {words} -o a.exr --json"));
        let json: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {output:?}"));
        json["plan"].clone()
    };
    let spp = |time: &str| {
        let plan = plan(&format!("--time {time} --denoise none"));
        assert!(plan["chosen"]["denoise"].is_null() && plan["others"] == serde_json::json!([]), "{plan}");
        plan["chosen"]["spp"].as_u64().unwrap()
    };
    // Twenty times the time is several times the samples even where other programs run.
    let [few, many] = ["100ms", "2s"].map(spp);
    assert!(many > 3 * few, "{few} and {many} samples");
    // Of several filters the one with the least error is taken.
    let free = plan("--time 1s");
    let (chosen, others) = (&free["chosen"], free["others"].as_array().unwrap());
    assert!(others.len() == 1 && chosen["relmse"].as_f64() <= others[0]["relmse"].as_f64(), "{free}");
    // What placed samples cost is told by a render of as many, which is a part of the probe.
    let placed = plan("--time 400ms --allocate both --denoise none");
    let [probe, planned] = [&placed["probe_ms"], &placed["chosen"]["gpu_ms"]].map(|ms| ms.as_f64().unwrap());
    assert!(probe > 0.4 * planned, "{placed}");
    // No more than a pixel may have, however much time there is.
    let few = plan("--time 20s --allocate both --max-spp 4 --denoise none");
    assert_eq!(few["chosen"]["spp"], 4, "{few}");
}

#[test]
fn what_cannot_be_planned_is_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let small = |words: &str| render(&folder, SCENE, &format!("{SMALL} -o a.exr {words}"));
    complains(&small("--time 1us"), 2, &["one sample a pixel takes", "0.001 ms were given", "smaller film"]);
    for time in ["5", "0s", "-1s"] {
        complains(&small(&format!("--time {time}")), 2, &["--time", "a time above 0 with its unit", "200ms"]);
    }
    complains(&small("--error=-1"), 2, &["an error of -1", "above 0"]);
    complains(&small("--error 1e-30"), 2, &["relMSE", "samples a pixel"]);
    complains(&small("--time 1s --noise-threshold 0.1"), 2, &["a noise threshold ends a render by itself"]);
    complains(&small("--time 1s --max-spp 9"), 2, &["leave out max_spp", "another policy"]);
    complains(&small("--error 0.5 --max-spp 9000"), 2, &["leave out max_spp"]);
    complains(&small("--error 0.001 --allocate both --max-spp 4"), 2, &["more than 4 samples", "max_spp"]);
    complains(&small("--time 1s --spp 4"), 2, &["--spp"]);
    complains(&small("--plan none.json"), 3, &["none.json"]);
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("old.json", "{\"version\": 99}");
    complains(&small("--plan old.json"), 3, &["old.json", "version 99"]);
    write("other.json", "[]");
    complains(&small("--plan other.json"), 3, &["is no plan"]);
    assert!(small("--error 0.5 --plan plan.json").status.success());
    let glass = Path::new(SCENE).with_file_name("glass.toml");
    complains(&render(&folder, glass.to_str().unwrap(), "--plan plan.json -o b.exr"), 2, &["another scene"]);
    complains(&render(&folder, SCENE, "--plan plan.json --seed 9 -o b.exr"), 2, &["leave out options"]);
    // Edited by hand, it would render something else than it says.
    let plan: Value = serde_json::from_slice(&std::fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let mut edited = plan.clone();
    edited["chosen"]["spp"] = (plan["settings"]["spp"].as_u64().unwrap() + 1).into();
    write("edited.json", &edited.to_string());
    complains(&render(&folder, SCENE, "--plan edited.json -o b.exr"), 3, &["edited.json", "chosen", "settings"]);
    let mut edited = plan;
    edited["target"] = serde_json::json!({ "gpu_ms": -1.0 });
    write("edited.json", &edited.to_string());
    complains(&render(&folder, SCENE, "--plan edited.json -o b.exr"), 3, &["edited.json", "a time of -1"]);
    assert!(!folder.path().join("b.exr").exists());
}
