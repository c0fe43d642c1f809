//! Handling of the signals that ask a command to stop: Ctrl-C (INT), TERM and HUP.
use super::{Exit, complain};
use crate::image::output;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

static ASKED: AtomicBool = AtomicBool::new(false);
static LISTENER: Mutex<Listener> = Mutex::new(Listener { first_ctrl_c: None, leave: true, line: String::new() });

/// A second Ctrl-C ends the process only if it comes this long after the first, because key repeat sends several.
const MEANT: Duration = Duration::from_secs(1);

struct Listener {
    first_ctrl_c: Option<Instant>,
    /// Whether a signal ends the process, because there is nothing to save.
    leave: bool,
    /// The message that is printed then.
    line: String,
}

impl Listener {
    /// Returns whether the process must end at once. TERM and HUP never end it when there is something to save.
    fn hear(&mut self, ctrl_c: bool, first_ask: bool, now: Instant) -> bool {
        let again = match (ctrl_c, self.first_ctrl_c) {
            (true, Some(first)) => now.duration_since(first) >= MEANT,
            (true, None) => {
                self.first_ctrl_c = Some(now);
                self.leave
            }
            (false, _) => false,
        };
        again || (first_ask && self.leave)
    }
}

fn listener() -> MutexGuard<'static, Listener> {
    LISTENER.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on a signal sets the returned flag. Code that works in steps checks it between steps and returns
/// [`Exit::Interrupted`] with the result so far. A second Ctrl-C at least a second after the first still ends the process.
/// Files are safe even then, because they get their names only when they are complete.
pub fn flag() -> &'static AtomicBool {
    let mut listener = listener();
    listener.leave = false;
    listener.line = "interrupted again: what was not written yet is lost".to_owned();
    &ASKED
}

/// From now on a signal ends the process with this line. Returns whether one came before.
pub fn leave_at_once(line: &str) -> bool {
    let mut listener = listener();
    listener.leave = true;
    listener.line = line.to_owned();
    ASKED.load(Ordering::SeqCst)
}

/// Prints `line` and ends the process as a signal does.
pub fn leave(line: &str) -> ! {
    let mut stderr = std::io::stderr();
    if stderr.is_terminal() {
        // A progress bar may be on the line.
        let _ = stderr.write_all(b"\r\x1b[K");
    }
    complain(line);
    exit(Exit::Interrupted as i32)
}

/// Ends the process from any thread without unwinding, because a driver may be in the middle of a call. Where all cores are busy with
/// others, Linux may take seconds to return its memory: the thread that is last does that, which may be one that the driver gave the
/// least priority (Mesa's for its cache of kernels). All is said and written by then.
pub fn exit(code: i32) -> ! {
    output::remove_unfinished();
    #[cfg(unix)]
    signal_hook::low_level::exit(code);
    #[cfg(not(unix))]
    std::process::exit(code)
}

/// Begins to listen for signals, which end the process with this line. Signals that the caller ignores (`nohup`, `&` in a
/// script) stay ignored. If no thread can be started, signals have their default effect.
pub fn install(line: &str) {
    leave_at_once(line);
    #[cfg(unix)]
    signals::listen(|ctrl_c| {
        let mut listener = listener();
        let first_ask = !ASKED.swap(true, Ordering::SeqCst);
        if listener.hear(ctrl_c, first_ask, Instant::now()) {
            leave(&listener.line);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns for each signal, given by its time in seconds and whether it is Ctrl-C, whether it ends the process.
    fn ends(leave: bool, signals: &[(f64, bool)]) -> Vec<bool> {
        let mut listener = Listener { first_ctrl_c: None, leave, line: String::new() };
        let begin = Instant::now();
        let at = |seconds| begin + Duration::from_secs_f64(seconds);
        signals.iter().enumerate().map(|(i, &(s, ctrl_c))| listener.hear(ctrl_c, i == 0, at(s))).collect()
    }

    #[test]
    fn only_a_second_ctrl_c_a_second_later_kills() {
        let (ctrl_c, other) = (true, false);
        assert_eq!(
            ends(false, &[(0.0, ctrl_c), (0.5, ctrl_c), (0.9, ctrl_c), (1.0, ctrl_c)]),
            [false, false, false, true]
        );
        assert_eq!(ends(false, &[(0.0, other), (2.0, other), (4.0, other)]), [false; 3]);
        assert_eq!(
            ends(false, &[(0.0, other), (5.0, ctrl_c), (5.5, ctrl_c), (6.0, ctrl_c)]),
            [false, false, false, true]
        );
        assert_eq!(ends(false, &[(0.0, ctrl_c), (5.0, other)]), [false; 2]);
    }

    #[test]
    fn what_nobody_would_miss_is_left_at_once() {
        assert_eq!(ends(true, &[(0.0, true)]), [true]);
        assert_eq!(ends(true, &[(0.0, false)]), [true]);
        // If a signal came while there was something to save, another TERM changes nothing, but the first Ctrl-C does.
        let mut listener = Listener { first_ctrl_c: None, leave: true, line: String::new() };
        assert!(!listener.hear(false, false, Instant::now()));
        assert!(listener.hear(true, false, Instant::now()));
    }
}

#[cfg(unix)]
mod signals {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use std::sync::mpsc;

    /// Starts a thread that calls `heard` for every signal, with whether it is Ctrl-C.
    pub fn listen(heard: fn(bool)) {
        let ignored = std::fs::read_to_string("/proc/self/status").map_or(0, |status| ignored(&status));
        let wanted = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| ignored & (1 << (signal - 1)) == 0);
        // By default SIGXFSZ ends the process. It is caught because the write also fails, with a better message.
        let signals: Vec<_> = wanted.chain([SIGXFSZ]).collect();
        let (ready, wait) = mpsc::channel();
        let listener = move || {
            let Ok(mut heard_of) = Signals::new(signals) else { return };
            let _ = ready.send(());
            heard_of.forever().filter(|&signal| signal != SIGXFSZ).for_each(|signal| heard(signal == SIGINT));
        };
        if std::thread::Builder::new().name("signals".into()).spawn(listener).is_ok() {
            let _ = wait.recv();
        }
    }

    /// Returns a bit for each signal that this process ignores, from Linux's `/proc`; other systems do not tell.
    fn ignored(status: &str) -> u64 {
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
    }

    #[cfg(test)]
    mod tests {
        #[test]
        fn ignored_signals_are_bits() {
            assert_eq!(super::ignored("Name:\tx\nSigBlk:\tff\nSigIgn:\t0000000000001001\n"), 0x1001);
            assert_eq!(super::ignored(""), 0);
        }
    }
}
