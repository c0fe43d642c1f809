//! Reports panics, which are bugs, in one line and ends the process with an exit code of their own.
use super::{complain, interrupt};
use std::panic::PanicHookInfo;
use std::sync::Mutex;

/// Exit code after a panic, EX_SOFTWARE of sysexits.h.
pub const EXIT_CODE: i32 = 70;

/// Installs a hook by which a panic on any thread ends the process, unless it is in a decoder, where it becomes an error
/// about the file. `RUST_BACKTRACE=1` adds a backtrace.
pub fn report_panics() {
    static FIRST: Mutex<()> = Mutex::new(());
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if crate::image::is_decoding() {
            return;
        }
        // Other threads that panic wait here until the process ends.
        let _first = FIRST.lock();
        complain(&line(panic));
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|wanted| wanted != "0") {
            tell(panic);
        }
        interrupt::exit(EXIT_CODE);
    }));
}

fn line(panic: &PanicHookInfo) -> String {
    let payload = panic.payload();
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("a panic");
    let place = panic.location().map(|place| format!(" ({place})")).unwrap_or_default();
    format!("error: internal error: {text}{place}: this is a bug of tallow, please report it with what you ran")
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Output};

    /// Runs the test below again in a process of its own that panics in the given way.
    fn ended_by(way: &str, backtrace: &str) -> Output {
        let mut again = Command::new(std::env::current_exe().unwrap());
        again.args(["--exact", "cli::crash::tests::a_panic_is_one_line_and_its_own_exit_code", "--nocapture"]);
        again.env("PLANTED_PANIC", way).env("RUST_BACKTRACE", backtrace).output().unwrap()
    }

    fn panic_by(way: &str) {
        super::report_panics();
        match way {
            "here" => panic!("planted\nhere"),
            "in a pool" => drop(rayon::join(|| (), || -> () { panic!("planted in a pool") })),
            "unseen" => {
                rayon::spawn(|| panic!("planted unseen"));
                std::thread::sleep(std::time::Duration::from_secs(60));
            }
            _ => drop(crate::image::contained(|| -> Result<(), String> { panic!("planted in a decoder") })),
        }
        std::process::exit(0);
    }

    #[test]
    fn a_panic_is_one_line_and_its_own_exit_code() {
        if let Ok(way) = std::env::var("PLANTED_PANIC") {
            panic_by(&way);
        }
        for way in ["here", "in a pool", "unseen"] {
            let output = ended_by(way, "0");
            let text = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(super::EXIT_CODE), "{text}");
            assert!(text.starts_with("error: internal error: planted") && text.contains("report"), "{text}");
            assert_eq!(text.lines().count(), 1, "{text}");
        }
        let traced = String::from_utf8(ended_by("here", "1").stderr).unwrap();
        assert!(traced.contains("stack backtrace"), "{traced}");
        let decoder = ended_by("in a decoder", "0");
        assert_eq!((decoder.status.code(), decoder.stderr.len()), (Some(0), 0), "{decoder:?}");
    }
}
