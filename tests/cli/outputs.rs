//! Tests the built program's outputs: all are tried, none replaces an input or another output, and printed text can be parsed.
#![cfg(target_os = "linux")]
use crate::child::{LONG, OFTEN, Running, SMALL, command};
use crate::command::{complains, scene};
use std::path::Path;
use std::process::{Command, Output};
use tallow::image::{self, Film, WriteOptions};
use tempfile::TempDir;

fn run(folder: &TempDir, words: &str) -> Output {
    command(folder.path(), words).output().unwrap()
}

#[track_caller]
fn well(output: &Output) {
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

fn render(folder: &TempDir, words: &str) -> Output {
    run(folder, &format!("render {} {SMALL} --spp 1 {words}", scene()))
}

#[test]
fn an_output_that_fails_keeps_no_other_from_being_written() {
    let folder = tempfile::tempdir().unwrap();
    // The picture fits into 64 blocks, all layers do not; SIGXFSZ is not ignored by the caller.
    let words = format!("render {} {SMALL} --spp 1 -o a.exr -o b.exr -o c.png", scene());
    let mut limited = Command::new("sh");
    let script = format!("ulimit -f 64; exec \"$0\" {words}");
    limited.args(["-c", &script, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path());
    complains(&limited.output().unwrap(), 5, &["a.exr", "; b.exr", "free some space"]);
    assert!(folder.path().join("c.png").exists() && !folder.path().join("a.exr").exists());
}

#[test]
fn a_frame_that_cannot_be_written_is_left_to_the_same_command() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    std::fs::create_dir(inside("frames")).unwrap();
    std::os::unix::fs::symlink("/dev/full", inside("frames/a.0.exr")).unwrap();
    let words = format!("sequence {} {SMALL} --spp 1 --frames 0..2 -o frames/a.#.exr", scene());
    let output = run(&folder, &words);
    complains(&output, 6, &["error: frame 0: frames/a.0.exr: cannot be written", "free some space"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{output:?}");
    std::fs::remove_file(inside("frames/a.0.exr")).unwrap();
    well(&run(&folder, &words));
    assert!(["frames/a.0.exr", "frames/a.1.exr"].iter().all(|name| image::read(&inside(name)).is_ok()));
}

#[test]
fn a_disk_that_takes_two_frames_in_a_row_no_more_ends_a_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let frame = |n: u32| folder.path().join(format!("a.{n}.exr"));
    let words = format!("sequence {} {SMALL} --spp 1 --frames 0..4 -o a.#.exr", scene());
    let full = |n: u32| std::os::unix::fs::symlink("/dev/full", frame(n)).unwrap();
    let told = || {
        let output = run(&folder, &words);
        assert_eq!(output.status.code(), Some(6), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    full(0);
    full(1);
    let text = told();
    let ends = "frames 0 and 1 could not be written, so that no more are rendered";
    assert!(text.lines().count() == 3 && text.contains(ends) && text.contains("goes on there"), "{text}");
    assert!(!frame(2).exists() && !frame(3).exists());
    std::fs::remove_file(frame(1)).unwrap();
    full(2);
    let text = told();
    assert!(text.lines().count() == 2 && !text.contains("no more"), "{text}");
    assert!(image::read(&frame(1)).is_ok() && image::read(&frame(3)).is_ok());
}

/// Interrupts a render whose folder has gone.
fn lost_folder(folder: &TempDir, cwd: &str) -> Output {
    let inside = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(inside("gone")).unwrap();
    std::fs::create_dir_all(inside("temporary")).unwrap();
    let place = inside("gone").display().to_string();
    let words = format!("render {} {LONG} {OFTEN} -o {place}/a.exr -o {}/b.png", scene(), folder.path().display());
    let mut begun = command(&inside(cwd), &words);
    begun.env("TMPDIR", inside("temporary"));
    let mut running = Running::start(begun, folder.path());
    running.until_there_is("gone/a.partial.exr");
    std::fs::rename(inside("gone"), inside("moved")).unwrap();
    running.send(&["INT"]);
    running.end()
}

#[test]
fn what_could_not_be_written_lies_elsewhere() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.exr"), "mine").unwrap();
    let output = lost_folder(&folder, ".");
    let text = String::from_utf8(output.stderr).unwrap();
    let last = text.lines().last().unwrap();
    assert_eq!(output.status.code(), Some(5), "{text}");
    assert!(last.contains("gone/a.exr: cannot be written") && last.contains("(it is in a-2.exr instead)"), "{text}");
    assert!(image::read(&folder.path().join("a-2.exr")).unwrap().channel("pending").is_some());
    assert_eq!(std::fs::read(folder.path().join("a.exr")).unwrap(), b"mine");
    assert!(folder.path().join("b.png").exists());
}

#[test]
fn where_the_working_folder_takes_nothing_that_for_temporary_files_does() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    std::fs::create_dir(inside("cwd")).unwrap();
    // Its reader goes before anything was read.
    assert!(Command::new("mkfifo").arg(inside("pipe.exr")).status().unwrap().success());
    let words = format!("render {} {SMALL} --spp 1 -o {}", scene(), inside("pipe.exr").display());
    std::fs::create_dir(inside("temporary")).unwrap();
    let mut begun = command(&inside("cwd"), &words);
    begun.env("TMPDIR", inside("temporary"));
    let mut running = Running::start(begun, folder.path());
    // Opened, and closed before anything was read.
    let reader = running.out_of("pipe.exr", std::fs::File::open);
    std::fs::remove_dir(inside("cwd")).unwrap();
    drop(reader);
    complains(&running.end(), 5, &["pipe.exr: cannot be written", "temporary/pipe.exr instead"]);
    image::read(&inside("temporary/pipe.exr")).unwrap();
}

#[test]
fn one_file_for_two_things_is_refused_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    well(&render(&folder, "-o a.exr -o b.exr"));
    std::fs::create_dir(inside("x")).unwrap();
    std::os::unix::fs::symlink("a.exr", inside("link.exr")).unwrap();
    std::fs::write(inside("s.toml"), "").unwrap();
    let before = std::fs::read(inside("a.exr")).unwrap();
    let refused = |words: &str, parts: &[&str]| complains(&run(&folder, words), 2, parts);
    for (words, other) in [
        ("-o s.png --heatmap s.png", "-o"),
        ("-o s.exr --profile ./x/../s.exr", "-o"),
        ("-o new.exr -o x/../new.exr", "-o"),
        ("-o a.exr -o link.exr", "-o"),
        ("--profile s.toml", "the scene"),
        ("--resume a.exr --profile a.exr", "--resume"),
        ("--resume a.exr --profile link.exr", "--resume"),
        ("--plan p.json --profile p.json", "--plan"),
        ("-o n.exr -o n.partial.exr --checkpoint 5", "-o"),
    ] {
        refused(&format!("render s.toml {words}"), &["is the same file as", other]);
    }
    refused("filter a.exr -o c.exr -o c.exr", &["same file as -o"]);
    refused("filter a.exr --reference b.exr -o b.exr", &["same file as --reference"]);
    std::fs::write(inside("d.png"), "").unwrap();
    refused("compare a.exr d.png --diff d.png", &["same file as B"]);
    assert_eq!(std::fs::read(inside("a.exr")).unwrap(), before);
    assert_eq!(std::fs::read(inside("s.toml")).unwrap(), b"");
    // What one may want: the same image on in its place.
    well(&render(&folder, "--resume a.exr -o a.exr"));
    well(&run(&folder, "filter b.exr --filter none --quiet -o b.exr"));
    well(&render(&folder, "-o e.exr --profile /dev/null"));
}

#[test]
fn read_only_files_are_refused_before_rendering() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    std::fs::write(&path, "old").unwrap();
    let mode = |mode| std::fs::set_permissions(&path, std::os::unix::fs::PermissionsExt::from_mode(mode)).unwrap();
    mode(0o444);
    complains(&run(&folder, "render missing.toml -o a.exr"), 5, &["a.exr", "read-only", "make it writable"]);
    mode(0o644);
    complains(&run(&folder, "render missing.toml -o a.exr"), 3, &["missing.toml"]);
}

#[test]
fn what_a_terminal_obeys_is_shown_and_not_sent() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl \u{1b}]0;OWNED\u{7}\nf 1 2 3\n";
    std::fs::write(inside("a.obj"), mesh).unwrap();
    let words = ["render", "a.obj", "--width", "8", "--height", "8", "--spp", "1", "-o", "a.png"];
    let raw = |bytes: &[u8]| bytes.iter().any(|&b| b < 32 && b != b'\n' || b == 127);
    let output = Command::new(env!("CARGO_BIN_EXE_tallow")).args(words).current_dir(folder.path()).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && text.contains("\\u{1b}]0;OWNED\\u{7}"), "{text}");
    assert!(!raw(&output.stderr) && !raw(&output.stdout), "{output:?}");
    let name = Path::new("two\nlines\u{1b}[31m.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_tallow")).arg("render").arg(name).output().unwrap();
    complains(&output, 3, &["two\\nlines\\u{1b}[31m.toml"]);
}

#[test]
fn noise_that_a_lens_shows_and_a_filter_leaves_is_told() {
    let folder = TempDir::new().unwrap();
    let told = |lens: f32, filter: &str| {
        let scene = format!(
            "[film]\nwidth = 8\nheight = 8\n[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\nlens_radius = {lens}\n\
             [environment]\nradiance = 1\n[[mesh]]\nshape = 'sphere'\n"
        );
        std::fs::write(folder.path().join("s.toml"), scene).unwrap();
        let output = run(&folder, &format!("render s.toml --spp 2 --denoise {filter} -o s.png"));
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap().contains("where the lens blurs")
    };
    assert_eq!(
        [told(0.1, "atrous"), told(0.1, "auto"), told(0.1, "none"), told(0.0, "atrous")],
        [true, false, false, false]
    );
    told(0.1, "none");
    let output = run(&folder, "sequence s.toml --frames 0..2 --turntable 90 --spp 1 --denoise atrous -o s.#.png");
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.matches("where the lens blurs").count(), 1, "{text}");
}

/// Of a scene that is named without a folder.
#[test]
fn files_of_the_working_folder_are_found_in_another_case() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("a.obj", b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    write("A.MTL", b"newmtl a\nmap_Kd C.PNG\n");
    let mut png = Vec::new();
    ::image::RgbImage::from_pixel(1, 1, ::image::Rgb([255, 0, 0]))
        .write_to(&mut std::io::Cursor::new(&mut png), ::image::ImageFormat::Png)
        .unwrap();
    write("c.png", &png);
    for scene in ["a.obj", "./a.obj"] {
        let output = run(&folder, &format!("render {scene} {SMALL} --spp 1 -o a.exr --json"));
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let warnings = json["warnings"].to_string();
        assert!(warnings.contains("found as") && !warnings.contains("no such"), "{scene}: {warnings}");
    }
}

#[test]
fn no_output_replaces_what_the_scene_is_made_of() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    let mut sky = Film::new(4, 2);
    sky.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 8]);
    image::write(&inside("sky.exr"), &sky, &WriteOptions::default()).unwrap();
    image::write(&inside("wood.png"), &sky, &WriteOptions::default()).unwrap();
    std::fs::write(inside("wood.mtl"), "newmtl wood\nmap_Kd wood.png\n").unwrap();
    let wall = "mtllib wood.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3\n";
    std::fs::write(inside("wall.obj"), wall).unwrap();
    let text = "[environment]\nfile = 'sky.exr'\n[[mesh]]\nfile = 'wall.obj'\n";
    std::fs::write(inside("sky.toml"), text).unwrap();
    let before = |name: &str| std::fs::read(inside(name)).unwrap();
    let small = "--width 8 --height 8 --spp 1 --max-depth 2";
    for (words, option, file) in [
        ("render sky.toml", "the default output", "sky.exr"),
        ("render sky.toml -o sky.exr", "-o", "sky.exr"),
        ("render sky.toml -o ./wood.png", "-o", "wood.png"),
        ("render wall.obj -o a.exr -o wood.png", "-o", "wood.png"),
        ("render sky.toml -o a.exr --profile wall.obj", "--profile", "wall.obj"),
        ("render sky.toml -o a.exr --heatmap wood.png", "--heatmap", "wood.png"),
        ("profile sky.toml --frames 2 --csv wood.mtl", "--csv", "wood.mtl"),
        ("profile sky.toml --frames 2 --trace wall.obj", "--trace", "wall.obj"),
    ] {
        let old = before(file);
        complains(&run(&folder, &format!("{words} {small}")), 2, &[option, file, "of which the scene is made"]);
        assert!(before(file) == old && !inside("a.exr").exists(), "{words}");
    }
    std::fs::rename(inside("wood.png"), inside("a.0001.png")).unwrap();
    std::fs::write(inside("wood.mtl"), "newmtl wood\nmap_Kd a.0001.png\n").unwrap();
    let sequence = format!("sequence wall.obj --frames 0..2 -o a.####.png {small}");
    complains(&run(&folder, &sequence), 2, &["-o", "a.0001.png", "of which the scene is made"]);
    assert!(!inside("a.0000.png").exists());
    well(&run(&folder, &format!("render sky.toml -o other.exr --quiet {small}")));
}
