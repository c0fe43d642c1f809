//! Ctrl-C: the first one asks, the second one kills.
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

static FLAG: AtomicBool = AtomicBool::new(false);

/// Set once the user has asked to stop, by Ctrl-C or a termination signal. Whoever works in steps looks at it between
/// two of them, and returns [`super::Exit::Interrupted`] with what there is.
///
/// The first call installs the handler. A second signal ends the process at once; files are safe even then, as they are
/// renamed only when complete.
pub fn flag() -> &'static AtomicBool {
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let handler = || {
            if FLAG.swap(true, Ordering::SeqCst) {
                std::process::exit(super::Exit::Interrupted as i32);
            }
        };
        // Without a handler Ctrl-C still ends the process, so a failure here is not worth a failed render.
        let _ = ctrlc::set_handler(handler);
    });
    &FLAG
}
