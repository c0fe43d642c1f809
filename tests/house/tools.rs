//! Runs the scripts below `tools` in an environment of stand-ins.
#![cfg(unix)]
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Stands for cargo: prints its arguments, the folder of outside data, and what a test program would.
const CARGO: &str = "#!/bin/sh
echo \"cargo $*\"
echo \"data ${TALLOW_DATA:-}\"
case \"$*\" in
*--include-ignored*) echo 'test result: ok. 3 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out' ;;
*) echo 'test result: ok. 1 passed; 0 failed; 2 ignored; 0 measured; 0 filtered out' ;;
esac
";

/// Stands for cargo where it builds: its last argument is the folder for what it makes.
const BUILDS: &str = "#!/bin/sh
echo \"cargo $*\"
for target; do :; done
mkdir -p \"$target/release\"
printf '#!/bin/sh\necho \"built $*\"\n' >\"$target/release/tallow\"
chmod +x \"$target/release/tallow\"
";

/// Stands for cargo where it packages, and checks the package, which fails where there is a glslc. What the package is built of is that of
/// the repository, unless a file `damage` names a file to spoil. It leaves out sources that are called `left_out`.
const PACKAGES: &str = "#!/bin/sh
makes() {
    printf '%s\\n' \"include_bytes!($1/spirv/path.spv)\" >\"$1/shaders.rs\"
    printf '{\"reason\":\"build-script-executed\",\"package_id\":\"tallow\",\"out_dir\":\"%s\"}' \"$1\"
}
case \"$*\" in
*--offline*)
    if [ -n \"$(command -v glslc)\" ]; then exit 1; fi
    makes \"$CARGO_TARGET_DIR/packaged\"
    damage=$CARGO_TARGET_DIR/../damage
    if [ -e \"$damage\" ]; then read -r file <\"$damage\"; echo spoilt >\"$CARGO_TARGET_DIR/packaged/$file\"; fi ;;
*--lib*)
    for out in out packaged; do
        mkdir -p \"$CARGO_TARGET_DIR/$out/spirv\"
        : >\"$CARGO_TARGET_DIR/$out/spirv/path.spv\"
    done
    makes \"$CARGO_TARGET_DIR/out\" ;;
package*)
    mkdir -p \"$CARGO_TARGET_DIR/package\"
    tar -czf \"$CARGO_TARGET_DIR/package/tallow-1.crate\" --exclude left_out --transform 's,^,tallow-1/,' spirv src ;;
esac
";

/// Copies of scripts of the repository, and stand-ins for what they start.
struct Scripts(TempDir);

impl Scripts {
    fn new(names: &[&str]) -> Self {
        let scripts = Self(tempfile::tempdir().unwrap());
        for name in names.iter().chain(&["tools/setup.sh"]) {
            let to = scripts.path("repository").join(name);
            fs::create_dir_all(to.parent().unwrap()).unwrap();
            fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join(name), to).unwrap();
        }
        scripts
    }

    /// Those that test, with `CARGO`.
    fn that_test() -> Self {
        let scripts = Self::new(&["tools/test"]);
        scripts.stand_in("bin/cargo", CARGO);
        // Else it would be downloaded.
        fs::create_dir_all(scripts.path("repository/target/ray-query-driver")).unwrap();
        fs::write(scripts.path("repository/target/ray-query-driver/driver.json"), "{}").unwrap();
        scripts
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn stand_in(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        fs::set_permissions(path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// A script that finds what is in `bin` first.
    fn command(&self, script: &str) -> Command {
        let mut command = Command::new(self.path("repository").join(script));
        let bins = format!("{}:{}", self.path("bin").display(), std::env::var("PATH").unwrap());
        command.env("PATH", bins).env_remove("TALLOW_DATA").env_remove("TALLOW_OIDN");
        command
    }
}

/// What a script that does its work says on stdout and on stderr.
fn said(command: &mut Command) -> [String; 2] {
    let output = command.output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(output.status.success(), "{out}{err}");
    [out, err]
}

/// The words that `tools/test` first hands to cargo beyond its own, and its last line.
fn tested(data: Option<&Path>, words: &str) -> (String, String) {
    let scripts = Scripts::that_test();
    let mut command = scripts.command("tools/test");
    command.args(words.split_whitespace()).envs(data.map(|data| ("TALLOW_DATA", data)));
    let [text, _] = said(&mut command);
    let own = scripts.path("repository/target").display().to_string();
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

#[test]
fn a_folder_of_outside_data_is_named_from_where_one_stands() {
    let scripts = Scripts::that_test();
    fs::create_dir_all(scripts.path("here/data")).unwrap();
    let mut command = scripts.command("tools/test");
    command.current_dir(scripts.path("here")).args(["--test", "scene"]);
    let [out, _] = said(command.env("TALLOW_DATA", "data"));
    let whole = fs::canonicalize(scripts.path("here/data")).unwrap();
    assert!(out.contains(&format!("data {}\n", whole.display())), "{out}");
    let output = command.env("TALLOW_DATA", "nowhere").output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), err.as_str()), (Some(1), "tallow: TALLOW_DATA names no folder: nowhere\n"));
}

#[test]
fn a_program_that_another_build_has_replaced_is_built_again() {
    let scripts = Scripts::new(&["tools/tallow"]);
    scripts.stand_in("bin/cargo", BUILDS);
    let is_built = || {
        let [out, err] = said(scripts.command("tools/tallow").arg("devices"));
        assert_eq!(out, "built devices\n");
        err.contains("cargo build")
    };
    assert_eq!([is_built(), is_built()], [true, false]);
    scripts.stand_in("repository/target/release/tallow", "#!/bin/sh\necho another\n");
    assert_eq!([is_built(), is_built()], [true, false]);
}

#[test]
fn a_package_is_checked_without_a_glslc_that_lies_beside_cargo() {
    let scripts = Scripts::new(&["tools/package"]);
    fs::create_dir_all(scripts.path("repository/src")).unwrap();
    scripts.stand_in("bin/cargo", PACKAGES);
    scripts.stand_in("bin/glslc", "");
    scripts.stand_in("repository/target/release/tallow", "#!/bin/sh\nfor file; do :; done\necho picture >\"$file\"\n");
    let [_, err] = said(scripts.command("tools/package").arg("--check"));
    assert!(err.contains("1 kernels") && err.ends_with("is the program of the repository and renders\n"), "{err}");
    let differs = || {
        let output = scripts.command("tools/package").arg("--check").output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && err.ends_with("the packaged crate differs from the repository\n"), "{err}");
    };
    for of_build in ["spirv/path.spv", "shaders.rs"] {
        fs::write(scripts.path("repository/damage"), of_build).unwrap();
        differs();
    }
    fs::remove_file(scripts.path("repository/damage")).unwrap();
    fs::write(scripts.path("repository/src/left_out"), "").unwrap();
    differs();
}

#[test]
fn continuous_integration_finds_a_cargo_that_is_not_on_the_path() {
    let scripts = Scripts::new(&[".ci/run"]);
    scripts.stand_in("repository/tools/test", "#!/bin/sh\necho tests\n");
    scripts.stand_in("repository/tools/package", "#!/bin/sh\necho \"package $*\"\n");
    scripts.stand_in("home/.cargo/bin/cargo", "#!/bin/sh\necho \"cargo $1\"\n");
    fs::create_dir(scripts.path("bin")).unwrap();
    // A distribution's cargo would lie beside them.
    for program in ["bash", "dirname", "readlink"] {
        let all = std::env::var_os("PATH").unwrap();
        let found = std::env::split_paths(&all).map(|folder| folder.join(program)).find(|path| path.exists()).unwrap();
        std::os::unix::fs::symlink(found, scripts.path("bin").join(program)).unwrap();
    }
    let mut command = scripts.command(".ci/run");
    let [out, _] = said(command.env("PATH", scripts.path("bin")).env("HOME", scripts.path("home")));
    assert_eq!(out, "tests\npackage --check\ncargo fmt\ncargo clippy\ncargo doc\n");
}
