//! Tests signals to the built program: which ones it obeys or ignores, and what it saves.
#![cfg(target_os = "linux")]
use crate::child::{LONG, OFTEN, Running, SMALL, command, spp_of_steps};
use crate::command::{complains, film, names, scene};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output};
use std::time::Duration;
use tallow::image::{self, Samples, WriteOptions};
use tempfile::TempDir;

fn start(folder: &TempDir, words: &str) -> Running {
    Running::start(command(folder.path(), words), folder.path())
}

/// Memory without a disk, where files need no name on every system.
fn in_memory() -> TempDir {
    tempfile::tempdir_in("/dev/shm").unwrap()
}

fn mkfifo(folder: &TempDir, name: &str) {
    assert!(Command::new("mkfifo").arg(folder.path().join(name)).status().unwrap().success());
}

#[test]
fn what_the_caller_has_switched_off_stays_off() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("render {} {SMALL} {OFTEN} --spp {} -o a.exr", scene(), spp_of_steps(96 * 80));
    let mut nohup = Command::new("sh");
    let script = format!("trap '' HUP INT; exec \"$0\" {words}");
    nohup.args(["-c", &script, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path());
    let mut running = Running::start(nohup, folder.path());
    running.until_there_is("a.partial.exr");
    running.send(&["HUP", "INT", "HUP"]);
    let output = running.end();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    assert!(film(&folder, "a.exr").channel("pending").is_none(), "it stopped");
}

#[test]
fn signals_that_come_together_ask_once() {
    // Those of a stopped process come at once when it goes on, each once.
    let at_once = ["STOP", "HUP", "INT", "TERM", "CONT"];
    for volley in [&["TERM", "HUP"][..], &["INT", "INT", "INT"], &at_once] {
        let folder = tempfile::tempdir().unwrap();
        let mut running = start(&folder, &format!("render {} {LONG} {OFTEN} -o a.exr", scene()));
        running.until_there_is("a.partial.exr");
        running.send(volley);
        complains(&running.end(), 130, &["interrupted: what there is was written to a.exr; --resume a.exr"]);
        assert_eq!(names(folder.path()), ["a.exr"], "{volley:?}");
        let film = film(&folder, "a.exr");
        assert!(film.channel("pending").is_some());
        assert!(matches!(film.channel("samples"), Some(Samples::U32(counts)) if counts.iter().any(|&n| n > 0)));
    }
}

/// It belongs to a render that crashed: its checkpoint is not replaced, and where the new one is, is told at once.
#[test]
fn a_checkpoint_of_another_render_stays() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.partial.exr"), "of another").unwrap();
    let mut running = start(&folder, &format!("render {} {LONG} {OFTEN} -o a.exr", scene()));
    running.until_there_is("a.partial-2.exr");
    running.send(&["TERM"]);
    let output = running.end();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        text.matches("a.partial.exr is another render's checkpoint: this one's is a.partial-2.exr").count(),
        1,
        "{text}"
    );
    assert_eq!(std::fs::read(folder.path().join("a.partial.exr")).unwrap(), b"of another");
}

#[test]
fn ctrl_c_ends_a_write_that_nobody_reads_after_all_others() {
    let folder = tempfile::tempdir().unwrap();
    mkfifo(&folder, "pipe.exr");
    let words = format!("render {} {SMALL} --spp 2 -o pipe.exr -o a.exr -o a.png --profile t.json", scene());
    let mut running = start(&folder, &words);
    // The last of the files.
    running.until_there_is("t.json");
    running.send(&["INT"]);
    complains(&running.end(), 130, &["pipe.exr", "not read", "all files are written"]);
    assert_eq!(names(folder.path()), ["a.exr", "a.png", "pipe.exr", "t.json"]);
    // An interrupted render may still have a reader: only Ctrl-C gives it up, however often TERM comes.
    let mut running = start(&folder, &format!("render {} {LONG} {OFTEN} -o pipe.exr -o b.exr", scene()));
    running.until_there_is("pipe.partial.exr");
    running.send(&["TERM"]);
    running.until_there_is("b.exr");
    running.until("its checkpoint is gone", |folder| !folder.join("pipe.partial.exr").exists());
    running.send(&["TERM", "HUP", "INT"]);
    // One that came while other files were written is not enough.
    std::thread::sleep(std::time::Duration::from_millis(1100));
    running.send(&["INT"]);
    complains(&running.end(), 130, &["pipe.exr", "not read"]);
    assert!(film(&folder, "b.exr").channel("pending").is_some());
}

#[test]
fn a_pipe_gets_the_image_once() {
    let folder = tempfile::tempdir().unwrap();
    mkfifo(&folder, "pipe.exr");
    let words = format!("render {} {SMALL} --spp 2 -o pipe.exr -o a.exr --denoise atrous", scene());
    let mut running = start(&folder, &words);
    running.until_there_is("a.exr");
    let read = running.out_of("pipe.exr", std::fs::read);
    let output = running.end();
    assert!(output.status.success(), "{output:?}");
    let (read, saved) = (image::decode(&read).unwrap(), film(&folder, "a.exr"));
    assert!(
        read.channel("Noisy Image.R").is_some()
            && read.picture(None).unwrap().pixels == saved.picture(None).unwrap().pixels
    );
}

#[test]
fn ctrl_c_is_heard_while_a_filter_runs() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("render {} --width 768 --height 768 --max-depth 2 --spp 1 --quiet", scene());
    let mut running = start(&folder, &format!("{words} --denoise auto -o a.png -o a.exr --heatmap map.png"));
    running.until_there_is("a.exr");
    running.send(&["INT"]);
    complains(
        &running.end(),
        130,
        &["the noisy image was written to a.exr,", "--denoise was not finished; --resume a.exr filters it"],
    );
    assert_eq!(names(folder.path()), ["a.exr"], "what the filter makes, or leaves as it is, is written once");
    // No more can be made of a picture alone: a checkpoint stays until the filter is done.
    let other = tempfile::tempdir().unwrap();
    let mut running = start(&other, &format!("{words} --denoise auto --checkpoint 1000 -o b.png"));
    running.until_there_is("b.partial.exr");
    running.send(&["INT"]);
    complains(&running.end(), 130, &["written to b.png, b.partial.exr,", "--resume b.partial.exr filters it"]);
    assert_eq!(names(other.path()), ["b.partial.exr", "b.png"]);
    let noisy = film(&folder, "a.exr");
    assert!(noisy.channel("Noisy Image.R").is_none() && noisy.channel("pending").is_none());
    let mut running = start(&folder, "filter a.exr --filter auto --quiet -o b.exr");
    running.until_it_listens();
    running.send(&["INT"]);
    complains(&running.end(), 130, &["interrupted: nothing was written"]);
    assert_eq!(names(folder.path()), ["a.exr"]);
    mkfifo(&folder, "pipe.exr");
    let mut running = start(&folder, "filter a.exr --filter none --quiet -o pipe.exr -o c.exr");
    running.until_there_is("c.exr");
    running.send(&["TERM"]);
    complains(&running.end(), 130, &["pipe.exr"]);
}

/// Its folder was made for what it would have written, with those above it.
#[test]
fn an_interrupted_measurement_without_a_run_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("cost {} --width 64 --height 64 --reference-spp 1000000 --quiet", scene());
    let mut running = start(&folder, &format!("{words} -o a/b/cost"));
    running.until_there_is("a/b/cost");
    running.send(&["INT"]);
    complains(&running.end(), 130, &["interrupted before a run was complete: nothing was written"]);
    assert_eq!(names(folder.path()), [""; 0]);
    // One that was there stays.
    std::fs::create_dir(folder.path().join("own")).unwrap();
    let mut running = start(&folder, &format!("{words} -o own"));
    running.until_it_listens();
    running.send(&["INT"]);
    assert_eq!(running.end().status.code(), Some(130));
    assert_eq!(names(folder.path()), ["own"]);
}

/// A run that goes on after finished frames has frames to speak of before it has written one itself.
#[test]
fn an_interrupted_sequence_says_that_finished_frames_stay() {
    let folder = tempfile::tempdir().unwrap();
    let words =
        format!("sequence {} --width 16 --height 16 --spp 1 --quiet --frames 0..100000 -o a.#####.exr", scene());
    let mut running = start(&folder, &words);
    running.until_there_is("a.00001.exr");
    running.send(&["INT"]);
    complains(
        &running.end(),
        130,
        &["interrupted in frame ", "finished frames stay, and the same command goes on there"],
    );
    let before = names(folder.path());
    assert!(before.len() > 1 && before.iter().all(|name| name.ends_with(".exr")), "{before:?}");
    let mut running = start(&folder, &words);
    running.until_it_listens();
    running.send(&["INT"]);
    complains(&running.end(), 130, &["finished frames stay"]);
    assert!(before.iter().all(|name| folder.path().join(name).is_file()));
}

/// A sequence that is stopped when its first frame is there, and what it printed.
fn stopped_after_a_frame(folder: &TempDir, words: &str, first: &str) -> (Output, serde_json::Value) {
    let words = format!("sequence {} {SMALL} --spp 300 --frames 0..10000 --json {words}", scene());
    let mut shell = Command::new("sh");
    let script = format!("exec env --default-signal=INT,HUP,TERM \"$0\" {words} > told");
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path());
    let mut running = Running::start(shell, folder.path());
    running.until_there_is(first);
    running.send(&["INT"]);
    let output = running.end();
    let told = std::fs::read(folder.path().join("told")).unwrap();
    (output, serde_json::from_slice(&told).unwrap_or_default())
}

/// Nothing goes on with samples of a frame that was stopped, and a picture of it would look like a finished one.
#[test]
fn an_interrupted_frame_is_not_written_and_the_ones_before_are_told() {
    for (kind, more, line) in [
        ("png", "", "rendered anew unless -o NAME.####.exr is given too"),
        ("exr", "", "the same command goes on there"),
        ("exr", "--again", "the same command without --again goes on there"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let (words, first) = (format!("-o a.####.{kind} {more}"), format!("a.0000.{kind}"));
        let (output, told) = stopped_after_a_frame(&folder, &words, &first);
        let files: Vec<_> = names(folder.path()).into_iter().filter(|name| name != "told").collect();
        let finished = files.len();
        complains(&output, 130, &[&format!("interrupted in frame {finished}: finished frames stay"), line]);
        assert_eq!(told["frames"].as_array().map(Vec::len), Some(finished), "{files:?}: {told}");
        assert_eq!(told["interrupted"], true);
        assert_eq!(files.last(), Some(&format!("a.{:04}.{kind}", finished - 1)), "{files:?}");
    }
}

/// So an animation can be judged before all of it is there. A preview of all frames stays.
#[test]
fn a_preview_of_an_interrupted_sequence_shows_the_frames_before() {
    use ::image::{AnimationDecoder, codecs::gif::GifDecoder};
    for (is_there, name) in [(false, "a.gif"), (true, "a.partial.gif")] {
        let folder = tempfile::tempdir().unwrap();
        if is_there {
            std::fs::write(folder.path().join("a.gif"), "whole").unwrap();
        }
        let (output, told) = stopped_after_a_frame(&folder, "-o a.####.exr --preview a.gif", "a.0000.exr");
        complains(&output, 130, &["interrupted in frame ", &format!("; {name} shows those before")]);
        let gif = std::fs::read(folder.path().join(name)).unwrap();
        let frames = GifDecoder::new(std::io::Cursor::new(gif)).unwrap().into_frames().count();
        assert_eq!(told["frames"].as_array().map(Vec::len), Some(frames), "{told}");
        assert_eq!(is_there, std::fs::read(folder.path().join("a.gif")).unwrap() == b"whole");
    }
}

/// A noisy picture under the name of a frame would look like a finished one.
#[test]
fn a_frame_is_written_when_it_is_filtered_and_not_before() {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("sequence {} --width 512 --height 512 --max-depth 2 --spp 1 --quiet", scene());
    let mut running = start(&folder, &format!("{words} --frames 0..10000 --denoise auto -o a.####.exr"));
    running.until_there_is("a.0000.exr");
    running.send(&["INT"]);
    complains(&running.end(), 130, &["interrupted in frame "]);
    let frames = names(folder.path());
    let is_filtered = |name: &String| film(&folder, name).channel("Noisy Image.R").is_some();
    assert!(frames.iter().all(is_filtered), "{frames:?}");
}

#[test]
fn explain_is_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let begun = || {
        let mut running = start(&folder, &format!("explain {}", scene()));
        let environment = format!("/proc/{}/environ", running.id());
        let again =
            |environment: &[u8]| String::from_utf8_lossy(environment).contains("MESA_SHADER_CACHE_DISABLE=true");
        running.until("it began again", |_| again(&std::fs::read(&environment).unwrap_or_default()));
        running.until_it_listens();
        running
    };
    for signal in ["TERM", "INT", "HUP"] {
        let running = begun();
        let children = std::fs::read_to_string(format!("/proc/{0}/task/{0}/children", running.id())).unwrap();
        assert_eq!(children, "", "a child");
        running.send(&[signal]);
        complains(&running.end(), 130, &["interrupted"]);
    }
    let running = begun();
    running.send(&["KILL"]);
    assert_eq!(running.end().status.signal(), Some(9));
}

#[test]
fn nothing_hidden_stays_whatever_ends_it() {
    for signal in ["KILL", "QUIT", "KILL"] {
        let folder = in_memory();
        let mut shell = Command::new("sh");
        // QUIT may leave an image of the process's memory.
        let script =
            format!("ulimit -c 0; exec env --default-signal=QUIT \"$0\" render {} {LONG} {OFTEN} -o a.exr", scene());
        shell.args(["-c", &script, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path());
        let mut running = Running::start(shell, folder.path());
        running.until("a checkpoint", |folder| names(folder).iter().any(|name| name.ends_with(".exr")));
        running.send(&[signal]);
        assert!(running.end().status.signal().is_some());
        assert!(names(folder.path()).iter().all(|name| name.ends_with(".exr")), "{:?}", names(folder.path()));
    }
    // Control: a file that is being written cannot be seen, whenever that is.
    let folder = in_memory();
    let path = folder.path().join("b.exr");
    let before = names(folder.path());
    image::output::write_with(&path, |stream| {
        stream.write_all(b"half")?;
        assert_eq!(names(folder.path()), before);
        stream.write_all(b"whole")
    })
    .unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"halfwhole");
}

/// Sends a signal to a render that writes checkpoints, and resumes it from what it leaves.
fn ended_by(signal: &str, left: &str, words: &str, spp: u64) {
    let folder = tempfile::tempdir().unwrap();
    let words = format!("render {} {SMALL} --spp {spp} {words}", scene());
    let mut running = start(&folder, &format!("{words} {OFTEN} -o a.exr"));
    running.until_there_is("a.partial.exr");
    running.send(&[signal]);
    let status = running.end().status;
    let expected = if signal == "KILL" { (Some(9), None) } else { (None, Some(130)) };
    assert_eq!((status.signal(), status.code()), expected, "was it over before {signal}? Raise its spp");
    assert_eq!(names(folder.path()), [left]);
    let part = film(&folder, left);
    assert!(part.channel("pending").is_some());
    // No checkpoint falls due once it goes on.
    for end in ["-o whole.exr", &format!("--checkpoint 1000 --resume {left} -o a.exr")] {
        let output = command(folder.path(), &format!("{words} {end}")).output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    }
    let (whole, resumed) = (film(&folder, "whole.exr"), film(&folder, "a.exr"));
    assert!(resumed.channel("pending").is_none());
    for layer in [None, Some("m2"), Some("variance"), Some("direct"), Some("indirect"), Some("samples")] {
        let [whole, resumed, part] = [&whole, &resumed, &part].map(|film| film.picture(layer).unwrap().pixels);
        assert!(whole == resumed, "{layer:?}");
        assert!(whole != part, "the comparison cannot fail");
    }
    assert_eq!(names(folder.path()), ["a.exr", "whole.exr"], "the checkpoint is not needed any more");
}

#[test]
fn a_killed_render_goes_on_from_its_checkpoint() {
    ended_by("KILL", "a.partial.exr", "", spp_of_steps(96 * 80));
    ended_by("KILL", "a.partial.exr", "--allocate variance --rounds 20", 100);
}

/// When a render comes to its plan and when it leaves it depends on the device.
#[test]
fn a_render_that_is_still_planned_says_so() {
    let after = |milliseconds: u64| {
        let folder = tempfile::tempdir().unwrap();
        let running = start(&folder, &format!("render {} {SMALL} --time 1000h -o a.exr", scene()));
        std::thread::sleep(Duration::from_millis(milliseconds));
        running.send(&["INT"]);
        (String::from_utf8(running.end().stderr).unwrap(), names(folder.path()).is_empty())
    };
    let told = "interrupted while the render was planned: nothing was rendered, and nothing written\n";
    let mut times = std::iter::successors(Some(200), |last| Some(last * 6 / 5)).take_while(|time| *time < 20_000);
    assert!(times.any(|time| after(time) == (told.to_owned(), true)));
}

#[test]
fn ctrl_c_writes_what_there_is_and_resuming_completes_it() {
    // Half as many again: two more steps begin after the one in which the signal should come.
    ended_by("INT", "a.exr", "", spp_of_steps(96 * 80) * 3 / 2);
    ended_by("INT", "a.exr", "--allocate variance --rounds 20", 100);
}

/// Of paths that would all fit one step.
#[test]
fn a_render_of_few_paths_writes_checkpoints_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut running = start(&folder, &format!("render {} {SMALL} {OFTEN} --spp 100 -o a.exr", scene()));
    running.until_there_is("a.partial.exr");
    assert!(running.end().status.success());
}

#[test]
fn what_was_finished_is_not_replaced_by_what_was_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let images = "-o a.exr -o a.png --heatmap map.png";
    let run = |words: &str| command(folder.path(), &format!("render {} {SMALL} {words}", scene())).output().unwrap();
    assert!(run(&format!("--spp 2 {images}")).status.success());
    let finished = ["a.exr", "a.png", "map.png"].map(|name| std::fs::read(folder.path().join(name)).unwrap());
    let mut running = start(&folder, &format!("render {} {LONG} {OFTEN} {images} -o fresh.exr", scene()));
    running.until_there_is("a.partial.exr");
    running.send(&["INT"]);
    complains(
        &running.end(),
        130,
        &["a.partial.exr, a.partial.png, fresh.exr, map.partial.png; --resume a.partial.exr"],
    );
    let after = ["a.exr", "a.png", "map.png"].map(|name| std::fs::read(folder.path().join(name)).unwrap());
    assert!(finished == after, "a finished file was replaced");
    assert!(film(&folder, "a.partial.exr").channel("pending").is_some());
    // It goes on from what it wrote, and may replace that.
    let before = std::fs::read(folder.path().join("a.partial.exr")).unwrap();
    let words = format!("render {} {LONG} {OFTEN} --resume a.partial.exr -o a.exr", scene());
    let mut running = start(&folder, &words);
    let changed = |folder: &Path| std::fs::read(folder.join("a.partial.exr")).unwrap() != before;
    running.until("it wrote a checkpoint", changed);
    running.send(&["INT"]);
    complains(&running.end(), 130, &["written to a.partial.exr; --resume a.partial.exr"]);
    assert!(!folder.path().join("a.partial-2.exr").exists());
}

#[test]
fn a_render_without_layers_keeps_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let mut running = start(&folder, &format!("render {} {LONG} {OFTEN} -o a.png", scene()));
    running.until_there_is("a.partial.exr");
    running.send(&["INT"]);
    complains(&running.end(), 130, &["a.png", "--resume a.partial.exr"]);
    assert_eq!(names(folder.path()), ["a.partial.exr", "a.png"]);
    image::write(&folder.path().join("x.exr"), &film(&folder, "a.partial.exr"), &WriteOptions::default()).unwrap();
}
