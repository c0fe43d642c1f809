//! The built program while it runs, and signals to it.
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};
use tallow::gpu::{DeviceOptions, Gpu};

/// Options of a small render.
pub const SMALL: &str = "--width 96 --height 80 --max-depth 3 --quiet";
/// A render that ends by itself only after days, of paths that end at once: what waits for its steps waits for less.
pub const LONG: &str = "--width 96 --height 80 --max-depth 1 --quiet --spp 10000000";
/// Writes checkpoints all the time.
pub const OFTEN: &str = "--checkpoint 0.000001";

/// Samples for each of so many pixels that take the device of the tests more than two steps, between which checkpoints are
/// written and signals are heard. A step takes a GPU but milliseconds: there it is given many.
pub fn spp_of_steps(pixels: u64) -> u64 {
    let gpu = Gpu::open(&DeviceOptions::default()).unwrap();
    let steps = if gpu.info().unified { 2.5 } else { 16.0 };
    (steps * gpu.tuning().paths_in_flight as f64 / pixels as f64) as u64
}

/// The program with these words.
pub fn command(folder: &Path, words: &str) -> Command {
    // A shell starts what runs in its background with INT ignored, and the tests would pass that on.
    let mut command = Command::new("env");
    command.arg("--default-signal=INT,HUP,TERM").arg(env!("CARGO_BIN_EXE_tallow"));
    command.current_dir(folder).args(words.split_whitespace());
    command
}

/// What is waited for comes within this time on any machine, or never.
const LONGEST: Duration = Duration::from_secs(600);

/// A process, and where it runs.
pub struct Running {
    /// It is killed when this is dropped.
    child: Child,
    folder: PathBuf,
}

impl Running {
    pub fn start(mut command: Command, folder: &Path) -> Self {
        let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        Self { child, folder: folder.to_owned() }
    }

    /// Waits until `done` says so.
    #[track_caller]
    pub fn until(&mut self, what: &str, done: impl Fn(&Path) -> bool) {
        let begun = Instant::now();
        while !done(&self.folder) {
            let ended = self.child.try_wait().unwrap();
            assert!(ended.is_none() || done(&self.folder), "it ended before {what}: {ended:?}");
            assert!(begun.elapsed() < LONGEST, "after {LONGEST:?} it still runs, and has not come to {what}");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// What comes out of a pipe that it writes, which blocks until it does; `take` opens the path.
    #[track_caller]
    pub fn out_of<T: Send + 'static>(&mut self, pipe: &str, take: fn(PathBuf) -> std::io::Result<T>) -> T {
        let path = self.folder.join(pipe);
        let reader = std::thread::spawn(move || take(path));
        let begun = Instant::now();
        let mut ended = None;
        while !reader.is_finished() {
            if self.child.try_wait().unwrap().is_some() {
                ended.get_or_insert_with(Instant::now);
            }
            // What it wrote last may still be on its way.
            assert!(
                ended.is_none_or(|ended: Instant| ended.elapsed() < LONGEST / 60),
                "it ended and left {pipe} alone"
            );
            assert!(begun.elapsed() < LONGEST, "after {LONGEST:?} it still runs, and has not written {pipe}");
            std::thread::sleep(Duration::from_millis(5));
        }
        reader.join().unwrap().unwrap()
    }

    /// Waits until the file exists.
    #[track_caller]
    pub fn until_there_is(&mut self, name: &str) {
        self.until(name, |folder| folder.join(name).exists());
    }

    /// Waits until it listens to signals.
    #[track_caller]
    pub fn until_it_listens(&mut self) {
        let status = format!("/proc/{}/status", self.id());
        // HUP, INT and TERM, which it installs one after the other.
        const ALL: u64 = 1 | 1 << 1 | 1 << 14;
        let caught = |line: &str| u64::from_str_radix(line.trim(), 16).unwrap() & ALL == ALL;
        self.until("it listened", |_| {
            let status = std::fs::read_to_string(&status).unwrap_or_default();
            status.lines().find_map(|line| line.strip_prefix("SigCgt:")).is_some_and(caught)
        });
    }

    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Sends signals, one right after the other.
    pub fn send(&self, signals: &[&str]) {
        // Of the shell: a bare system has no program of that name.
        let script = signals.iter().map(|signal| format!("kill -{signal} {};", self.id())).collect::<String>();
        assert!(Command::new("sh").args(["-c", &script]).status().unwrap().success());
    }

    /// Waits until the program ends. One that does not is killed.
    pub fn end(mut self) -> Output {
        let (over, wait) = channel::<()>();
        let kill = format!("kill -KILL {}", self.id());
        let watch = std::thread::spawn(move || {
            if wait.recv_timeout(LONGEST) == Err(RecvTimeoutError::Timeout) {
                let _ = Command::new("sh").args(["-c", &kill]).status();
            }
        });
        let output = self.read_to_end();
        drop(over);
        watch.join().unwrap();
        output
    }

    fn read_to_end(&mut self) -> Output {
        let mut stderr = Vec::new();
        std::io::Read::read_to_end(self.child.stderr.as_mut().unwrap(), &mut stderr).unwrap();
        Output { status: self.child.wait().unwrap(), stdout: Vec::new(), stderr }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
