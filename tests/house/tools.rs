//! Runs the scripts below `tools` in an environment of stand-ins.
#![cfg(unix)]
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

/// Stands for cargo: prints its arguments, and what a test program would.
const CARGO: &str = "#!/bin/sh
echo \"cargo $*\"
case \"$*\" in
*--include-ignored*) echo 'test result: ok. 3 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out' ;;
*) echo 'test result: ok. 1 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out' ;;
esac
";

/// The words that `tools/test` first hands to cargo beyond its own, and its last line.
fn tested(data: Option<&Path>, words: &str) -> (String, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir_all(path("repository/tools")).unwrap();
    for script in ["test", "setup.sh"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools").join(script);
        fs::copy(from, path("repository/tools").join(script)).unwrap();
    }
    // Else it would be downloaded.
    fs::create_dir_all(path("repository/target/ray-query-driver")).unwrap();
    fs::write(path("repository/target/ray-query-driver/driver.json"), "{}").unwrap();
    fs::create_dir(path("bin")).unwrap();
    fs::write(path("bin/cargo"), CARGO).unwrap();
    fs::set_permissions(path("bin/cargo"), fs::Permissions::from_mode(0o755)).unwrap();
    let mut command = Command::new(path("repository/tools/test"));
    let bins = format!("{}:{}", path("bin").display(), std::env::var("PATH").unwrap());
    command.env("PATH", bins).env_remove("TALLOW_DATA").env_remove("TALLOW_OIDN").args(words.split_whitespace());
    command.envs(data.map(|data| ("TALLOW_DATA", data)));
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let own = path("repository/target").display().to_string();
    let (_, more) = text.lines().next().unwrap().split_once(&own).unwrap();
    (more.trim().to_owned(), text.lines().last().unwrap().to_owned())
}

#[test]
fn tests_with_outside_data_run_where_it_is_and_are_skipped_where_not() {
    let data = tempfile::tempdir().unwrap();
    assert_eq!(tested(None, "--test scene"), ("--test scene".into(), "1 passed, 0 failed, 2 skipped".into()));
    // All tests, those of the documentation, and those of ray queries.
    let all = "9 passed, 0 failed, 0 skipped";
    // Where nobody names the library that it needs.
    let left_out = " --skip oidn::the_library_itself";
    assert_eq!(tested(Some(data.path()), ""), (format!("--tests -- --include-ignored{left_out}"), all.into()));
    let with = |words| tested(Some(data.path()), words).0;
    assert_eq!(with("--test scene"), format!("--test scene -- --include-ignored{left_out}"));
    assert_eq!(
        with("--test scene -- --nocapture a"),
        format!("--test scene -- --nocapture a --include-ignored{left_out}")
    );
    assert_eq!(with("-- --ignored"), "--tests -- --ignored");
    assert_eq!(with("-- --include-ignored"), "--tests -- --include-ignored");
}
