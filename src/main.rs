//! The `tallow` command.
fn main() -> std::process::ExitCode {
    tallow::cli::main()
}
