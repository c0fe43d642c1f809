//! Tests the built program's messages without a Vulkan loader, driver or device, and when it loses its device while it renders.
#![cfg(target_os = "linux")]
use crate::child::command;
use crate::command::{complains, scene, stdout};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;
use tallow::gpu::{DeviceOptions, Gpu};
use tempfile::TempDir;

/// Renders over an old file, with a folder in front of those that libraries are looked for in.
fn render(folder: &TempDir, environment: &[(&str, &str)]) -> Output {
    std::fs::write(folder.path().join("a.exr"), "old").unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_tallow"));
    command.args(["render", scene, "-o", "a.exr", "--width", "32", "--height", "32", "--spp", "4", "--quiet"]);
    command.current_dir(folder.path()).env("LD_LIBRARY_PATH", folder.path());
    command.envs(environment.iter().copied()).output().unwrap()
}

#[track_caller]
fn fails(folder: &TempDir, environment: &[(&str, &str)], parts: &[&str]) {
    complains(&render(folder, environment), 4, parts);
    assert_eq!(std::fs::read(folder.path().join("a.exr")).unwrap(), b"old");
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| name == "a.exr" || name == "libvulkan.so.1"), "{left:?}");
}

#[test]
fn no_loader_and_no_driver_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let nothing = [("VK_DRIVER_FILES", "/nothing.json"), ("VK_ICD_FILENAMES", "/nothing.json")];
    fails(&folder, &nothing, &["no Vulkan driver", "mesa-vulkan-drivers"]);
    std::fs::write(folder.path().join("libvulkan.so.1"), "no library").unwrap();
    fails(&folder, &[], &["no Vulkan loader", "libvulkan1"]);
}

/// As of a variable that is not set: it is a part of every name.
#[test]
fn a_device_without_a_name_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = command(folder.path(), &format!("render {} --spp 1 --width 8 --height 8", scene()));
    complains(&command.args(["--device", ""]).output().unwrap(), 4, &["no device is called \"\": choose one of 0: "]);
}

#[test]
fn effects_are_listed_without_a_driver() {
    let folder = tempfile::tempdir().unwrap();
    let explain = |words: &str| {
        let mut command = command(folder.path(), &format!("explain {} --json {words}", scene()));
        command.env("VK_DRIVER_FILES", "/nothing.json").env("VK_ICD_FILENAMES", "/nothing.json").output().unwrap()
    };
    complains(&explain(""), 4, &["no Vulkan driver"]);
    let document: serde_json::Value = serde_json::from_str(&stdout(&explain("--no-measure"))).unwrap();
    let rows = document["effects"].as_array().unwrap();
    let row = |name| rows.iter().find(|row| row["effect"] == name).unwrap();
    let [emissive, textures] = ["emissive", "textures"].map(row);
    assert_eq!((&emissive["on"], &emissive["called_for_by"]), (&true.into(), &"material \"light\"".into()));
    assert_eq!((&textures["on"], &textures["bytes"]), (&false.into(), &serde_json::Value::Null));
    assert!(rows.iter().any(|row| row["effect"] == "guides"));
}

/// The Vulkan loader that programs get.
fn loader() -> PathBuf {
    let _gpu = Gpu::open(&DeviceOptions::default()).unwrap();
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
    let line = maps.lines().find(|line| line.contains("/libvulkan.so")).expect("a loaded loader");
    PathBuf::from(&line[line.find('/').unwrap()..])
}

fn compile(source: &Path, library: &Path) {
    // Cargo says where it lies itself; the compiler lies beside it.
    let rustc = Path::new(env!("CARGO")).with_file_name("rustc");
    let mut command = Command::new(if rustc.exists() { rustc } else { "rustc".into() });
    command.args(["--edition=2024", "--crate-type=cdylib", "-O"]).arg(source).arg("-o").arg(library);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Puts `support/lost_loader.rs` before the loader, and says where that lies.
fn stand_in(folder: &TempDir) -> PathBuf {
    static LIBRARY: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let library = folder.path().join("libvulkan.so.1");
        compile(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/support/lost_loader.rs"), &library);
        std::fs::read(library).unwrap()
    });
    std::fs::write(folder.path().join("libvulkan.so.1"), &*LIBRARY).unwrap();
    loader()
}

#[test]
fn drivers_without_a_device_are_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let real = stand_in(&folder);
    let real = ("REAL_LOADER", real.to_str().unwrap());
    let told = ["no Vulkan device", "mesa-vulkan-drivers"];
    fails(&folder, &[real, ("NO_DEVICE", "1")], &told);
    let mut devices = Command::new(env!("CARGO_BIN_EXE_tallow"));
    devices.arg("devices").env("LD_LIBRARY_PATH", folder.path()).envs([real, ("NO_DEVICE", "1")]);
    complains(&devices.output().unwrap(), 4, &told);
    let control = render(&folder, &[real]);
    assert!(control.status.success(), "the same loader with its devices: {control:?}");
}

#[test]
fn a_device_that_cannot_be_set_up_is_closed_before_its_instance() {
    let folder = tempfile::tempdir().unwrap();
    let real = stand_in(&folder);
    let real = ("REAL_LOADER", real.to_str().unwrap());
    fails(&folder, &[real, ("NO_CACHE", "1")], &["pipeline cache", "out of memory"]);
    let control = render(&folder, &[real]);
    assert!(control.status.success(), "the same loader with a cache: {control:?}");
}

#[cfg(unix)]
#[test]
fn compiled_pipelines_are_kept_in_a_folder_of_the_users_own() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let caches = folder.path().join("caches");
    assert!(render(&folder, &[("XDG_CACHE_HOME", caches.to_str().unwrap())]).status.success());
    let kept: Vec<_> = std::fs::read_dir(caches.join("tallow")).unwrap().map(|e| e.unwrap().path()).collect();
    assert!(kept.len() == 1 && kept[0].extension().is_some_and(|e| e == "bin"), "{kept:?}");
    let mode = std::fs::metadata(caches.join("tallow")).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o700, "{mode:o}");
}

/// Number of files below a folder.
fn files(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().map(|e| e.unwrap().path());
    entries.map(|path| if path.is_dir() { files(&path) } else { 1 }).sum()
}

/// llvmpipe keeps a file for each kernel that it has compiled. Buffers have less than 256 bytes, a power of two, both, and neither.
#[test]
fn films_of_all_sizes_share_what_llvmpipe_has_compiled() {
    let folder = tempfile::tempdir().unwrap();
    let kept = |[width, height]: [u32; 2]| {
        let words = format!("render {} --spp 2 --denoise atrous -o a.exr --quiet", scene());
        let mut command = command(folder.path(), &format!("{words} --width {width} --height {height}"));
        command.env("MESA_SHADER_CACHE_DIR", folder.path().join("mesa"));
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        files(&folder.path().join("mesa"))
    };
    let sizes = [[31, 17], [32, 32], [64, 64], [3, 2], [2, 2]];
    let counts = sizes.map(kept);
    assert!(counts.iter().all(|count| *count == counts[0]), "{counts:?}");
    let is_llvmpipe = Gpu::open(&DeviceOptions::default()).unwrap().info().name.contains("llvmpipe");
    assert!(counts[0] >= 5 || !is_llvmpipe, "control: {counts:?}");
}

#[test]
fn a_lost_device_is_one_line_and_keeps_the_old_file() {
    let folder = tempfile::tempdir().unwrap();
    let (real, lost) = (stand_in(&folder), ["the device was lost", "run again"]);
    let real = ("REAL_LOADER", real.to_str().unwrap());
    // There are two submissions: what begins a render, and its only batch.
    fails(&folder, &[real, ("LOSE_AT", "1")], &lost);
    fails(&folder, &[real, ("LOSE_AT", "2")], &lost);
    let control = render(&folder, &[real]);
    assert!(control.status.success(), "nothing fails without the loss: {control:?}");
    assert_ne!(std::fs::read(folder.path().join("a.exr")).unwrap(), b"old");
}

/// Three frames, in the second of which there is more than ever before.
fn sequence(folder: &TempDir, environment: &[(&str, &str)]) -> Output {
    let cube = |i: usize| {
        format!(
            "[[instance]]\nname = 'i{i}'\nmesh = 'cube'\ntransform = {{ translate = [{}, {}, 0], scale = 0.1 }}\n\
             [[animation]]\ninstance = 'i{i}'\ninterpolation = 'step'\n\
             keys = [{{ time = 0, scale = 0 }}, {{ time = 1, scale = 0.15 }}]\n",
            (i % 6) as f32 * 0.4 - 1.0,
            (i / 6) as f32 * 0.4 - 1.0
        )
    };
    let text = "[camera]\nposition = [0, 0, 5]\ntarget = [0, 0, 0]\n[environment]\nradiance = 1\n\
                [[mesh]]\nname = 'cube'\nshape = 'cube'\n";
    let text = (0..36).map(cube).fold(text.to_owned(), |text, cube| text + &cube);
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    let words = "sequence s.toml --width 24 --height 24 --spp 1 --frames 0..3 --fps 1 --reproject off --again \
                 -o f.#.exr --json";
    let mut command = command(folder.path(), words);
    command.env("LD_LIBRARY_PATH", folder.path()).envs(environment.iter().copied()).output().unwrap()
}

/// Frame 0 takes two submissions, as a picture does, and the third brings the changes of frame 1.
#[test]
fn a_frame_after_one_that_failed_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let real = stand_in(&folder);
    let real = ("REAL_LOADER", real.to_str().unwrap());
    let last = || tallow::image::read(&folder.path().join("f.2.exr")).unwrap().picture(None).unwrap().pixels;
    let control = sequence(&folder, &[real]);
    assert!(control.status.success(), "{control:?}");
    let whole = last();
    complains(&sequence(&folder, &[real, ("FAIL_AT", "3")]), 6, &["error: frame 1: ", "out of memory"]);
    assert!(last() == whole);
}

#[test]
fn a_lost_device_leaves_the_reports_of_the_frames_before() {
    let folder = tempfile::tempdir().unwrap();
    let real = stand_in(&folder);
    let lost = sequence(&folder, &[("REAL_LOADER", real.to_str().unwrap()), ("LOSE_AT", "4")]);
    complains(&lost, 4, &["the device was lost", "run again"]);
    let summary: serde_json::Value = serde_json::from_str(&stdout(&lost)).unwrap();
    let errors: Vec<_> = summary["frames"].as_array().unwrap().iter().map(|frame| frame["error"].as_str()).collect();
    assert_eq!((errors.len(), errors[0], &summary["failed"]), (2, None, &1.into()), "{summary}");
    assert!(errors[1].is_some_and(|error| error.contains("the device was lost")), "{summary}");
}
