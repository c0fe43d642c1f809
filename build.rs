//! Every `.comp` file below `glsl/` becomes SPIR-V and `$OUT_DIR/shaders.rs`: one module per kernel, with a typed field per binding and per
//! specialisation constant, so that a forgotten buffer or a constant that a kernel does not have does not compile.
//! `glsl/test/*.comp`, and kernels that tests run by themselves, become `$OUT_DIR/test_shaders.rs`. Any error stops the build with
//! file and line. `src/spirv/compact.rs` numbers their ids without gaps. The compiler is `glslc`, as a program: Debian 12's
//! libshaderc cannot be linked (undefined symbols).
//! A packaged crate needs no compiler: it carries what `tools/package` compiled, in `spirv/`, under names that tell of which
//! sources it was made. A checkout has no such folder.
//!
//! The interface of a kernel is read from lines of exactly these forms, in itself or in a file that it includes. What a
//! shared file declares is a module `shared::NAME`, and one field of the `Bind` and the `Constants` of its kernels.
//! ```glsl
//! layout(local_size_x = 64) in;                                     // or local_size_x_id, and local_size_y beside it
//! layout(constant_id = 110) const bool SQUARED = true;              // a field of `Constants`
//! const uint ROWS = 4u;                                             // a number that Rust may use: `atrous::ROWS`
//! layout(scalar, binding = 3) readonly buffer Src { vec3 src[]; };  // or writeonly, or neither
//! layout(scalar, binding = 3) writeonly buffer Dst { u64vec2 dst[]; }; // of vec4, which it stores two floats at a time
//! layout(binding = 0) uniform usamplerBuffer nodes; // of BvhNode   // or samplerBuffer of floats
//! layout(scalar, binding = 3) uniform Frame { FrameConstants frame; }; // the first of a buffer
//! layout(binding = 19) uniform accelerationStructureEXT world;      // in a form that traces by ray queries: see `gpu::Acceleration`
//! layout(scalar, push_constant) uniform Push { PathPush push; };    // once per kernel
//! ```
//! Structs of `src/layout` that a kernel binds come with functions, so that no kernel knows where their fields lie: see
//! `tools/build/structs.rs`.
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{env, fs};
use xxhash_rust::xxh3::{Xxh3Default, xxh3_64};

#[allow(dead_code, unused_imports)]
#[path = "src/layout/mod.rs"]
mod layout;

#[allow(dead_code, unused_imports)]
#[path = "src/spirv/mod.rs"]
mod spirv;

#[path = "tools/build/emit.rs"]
mod emit;
#[path = "tools/build/interface.rs"]
mod interface;
#[path = "tools/build/structs.rs"]
mod structs;

use emit::{Binaries, Group};
use interface::{EFFECTS, Interface, Source};

/// The first lines of every kernel.
const HEADER: &str = "#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
";

/// Kernels that mention it are compiled once more with it defined, for devices that trace rays by ray queries. Lanes then have no
/// triangles to deal to each other.
const RAY_QUERY: &str = "RAY_QUERY";

/// The compiled kernels that a packaged crate carries.
const PACKAGED: &str = "spirv";

fn main() {
    if let Err(error) = build() {
        eprintln!("{error:#}");
        std::process::exit(1);
    }
}

fn build() -> Result<()> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=src/layout");
    println!("cargo:rerun-if-changed=src/spirv");
    println!("cargo:rerun-if-changed=tools/build");
    println!("cargo:rerun-if-changed=glsl");
    if Path::new(PACKAGED).exists() {
        println!("cargo:rerun-if-changed={PACKAGED}");
    }
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let compiled = out.join("spirv");
    if compiled.exists() {
        fs::remove_dir_all(&compiled)?; // kernels of earlier sources
    }
    fs::create_dir(&compiled)?;
    let store = store(&out)?;
    let (tests, own) =
        kernels(Path::new("glsl"))?.into_iter().partition::<Vec<_>, _>(|file| file.starts_with("glsl/test"));
    generate(&own, "crate", &store, &out.join("shaders.rs"))?;
    let alone = ["glsl/film/accumulate.comp", "glsl/profile/ceiling_arithmetic.comp", "glsl/profile/ceiling_copy.comp"];
    let tested = [&tests[..], &alone.map(PathBuf::from)].concat();
    generate(&tested, "tallow", &store, &out.join("test_shaders.rs"))?;
    for entry in fs::read_dir(&store)? {
        let entry = entry?;
        if !compiled.join(entry.file_name()).exists() {
            fs::remove_file(entry.path())?; // of earlier sources
        }
    }
    Ok(())
}

/// Where compiled kernels stay for later builds of the same sources, in the profile's folder: clippy runs a build script of its own, and
/// most edits change few kernels. A packaged crate, which carries its kernels, leaves nothing there. `cargo clean` forgets them, as is
/// due after a change of `glslc`.
fn store(out: &Path) -> Result<PathBuf> {
    let parent = if Path::new(PACKAGED).exists() { Some(out) } else { out.ancestors().nth(3) };
    let store = parent.context("OUT_DIR lies in the target folder")?.join("compiled");
    fs::create_dir_all(&store).with_context(|| format!("{}: cannot be made", store.display()))?;
    Ok(store)
}

/// The kernels below `folder`, by name.
fn kernels(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| format!("{}: cannot be listed", folder.display()))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(kernels(&path)?);
        } else if path.extension().is_some_and(|e| e == "comp") {
            files.push(path);
        }
    }
    files.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    Ok(files)
}

/// A kernel as it goes to the compiler.
struct Kernel<'a> {
    name: &'a str,
    file: &'a Path,
    interface: Interface,
    /// Its code for most devices.
    usual: Code<'a>,
    /// That for devices that trace rays by ray queries, if it traces any.
    ray_query: Option<Code<'a>>,
}

struct Code<'a> {
    file: &'a Path,
    whole: String,
    binary: PathBuf,
}

impl<'a> Kernel<'a> {
    fn read(file: &'a Path, compiled: &Path) -> Result<Self> {
        let name = file.file_stem().and_then(|s| s.to_str()).context("kernel names are ASCII")?;
        let (text, sources) = preprocess(file)?;
        let interface = Interface::of(&sources)?;
        let text = structs::glsl(&interface.bindings) + &text;
        let code = |defines: &str| {
            let whole = [HEADER, defines, &text].concat();
            let binary = compiled.join(format!("{name}-{:016x}.spv", xxh3_64(whole.as_bytes())));
            Code { file, whole, binary }
        };
        let ray_query = text.contains(RAY_QUERY).then(|| code(&format!("#define {RAY_QUERY}\n")));
        Ok(Self { name, file, usual: code(""), ray_query, interface })
    }

    fn code(&self) -> impl Iterator<Item = &Code<'a>> {
        [&self.usual].into_iter().chain(&self.ray_query)
    }
}

impl Code<'_> {
    fn compile(&self, store: &Path) -> Result<()> {
        let name = self.binary.file_name().context("a file")?;
        let (packaged, stored) = (Path::new(PACKAGED).join(name), store.join(name));
        let from = if packaged.exists() { packaged } else { stored };
        if !from.exists() {
            let partial = from.with_extension("partial"); // a build can be interrupted
            fs::write(&partial, compile(self.file, &self.whole)?)?;
            fs::rename(&partial, &from)?;
        }
        let words: Vec<u32> = fs::read(&from)?.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect();
        // What another version of the compiler writes may be beyond it: such a kernel only takes longer to load.
        let dense = spirv::compact::compact(&words).unwrap_or(words);
        fs::write(&self.binary, bytemuck::cast_slice(&dense))?;
        Ok(())
    }
}

/// Compiles on all cores: each thread takes the next one until none is left.
fn compile_all(code: &[&Code], store: &Path) -> Result<()> {
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some(code) = code.get(next.fetch_add(1, Ordering::Relaxed)) {
            code.compile(store)?;
        }
        anyhow::Ok(())
    };
    std::thread::scope(|scope| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let running: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        running.into_iter().try_for_each(|thread| thread.join().expect("compiling does not panic"))
    })
}

/// Compiles `files`, but for what `store` has; `root` is the path by which the generated code reaches the crate.
fn generate(files: &[PathBuf], root: &str, store: &Path, target: &Path) -> Result<()> {
    let (mut code, mut hash) = (String::new(), Xxh3Default::new());
    let folder = target.with_file_name("spirv");
    let kernels = files.iter().map(|file| Kernel::read(file, &folder)).collect::<Result<Vec<_>>>()?;
    compile_all(&kernels.iter().flat_map(Kernel::code).collect::<Vec<_>>(), store)?;
    let mut groups = BTreeMap::new();
    for kernel in &kernels {
        for compiled in kernel.code() {
            hash.update(&fs::read(&compiled.binary)?);
        }
        let Kernel { name, file, interface, usual, ray_query } = kernel;
        let binaries = Binaries { usual: &usual.binary, ray_query: ray_query.as_ref().map(|code| &*code.binary) };
        code += &emit::module(name, file, interface, root, &binaries)?;
        groups.extend(interface.groups().into_iter().map(|group| (group.clone(), declared(interface, group))));
    }
    // The integration tests take these from the crate.
    if root == "crate" {
        code += "/// What files under `glsl/shared` declare, by their names.\npub mod shared {\n";
        for group in groups.values() {
            code += &emit::group_module(group)?;
        }
        code += "}\n";
    }
    writeln!(code, "/// xxh3 of the SPIR-V of every kernel, part of the pipeline cache's name.")?;
    writeln!(code, "pub const HASH: u64 = {:#018x};", hash.digest())?;
    fs::write(target, code).with_context(|| format!("{}: cannot be written", target.display()))
}

fn declared(interface: &Interface, name: String) -> Group {
    Group {
        bindings: interface.bindings_of(Some(&name)),
        constants: interface.constants_of(Some(&name)),
        numbers: interface.numbers_of(Some(&name)),
        name,
    }
}

/// The kernel with all that it includes, and the files it was made from: itself first.
fn preprocess(file: &Path) -> Result<(String, Vec<Source>)> {
    // The same on every system: a packaged crate finds its kernels by the whole text.
    let label = file.display().to_string().replace('\\', "/");
    let text = fs::read_to_string(file).with_context(|| label.clone())?;
    let mut sources = vec![(label.clone(), text.clone())];
    let whole = format!("#line 1 \"{label}\"\n{}", expand(&label, &text, &mut sources)?);
    Ok((whole, sources))
}

fn compile(file: &Path, whole: &str) -> Result<Vec<u8>> {
    let label = file.display();
    let mut child = Command::new("glslc")
        .args(["-fshader-stage=compute", "--target-env=vulkan1.3", "-O", "-Werror", "-o", "-", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .context("glslc cannot be started: install the package glslc (on some distributions: shaderc)")?;
    // Nothing is printed before all is read, so this cannot block on a full pipe.
    child.stdin.take().context("glslc has no input")?.write_all(whole.as_bytes())?;
    let output = child.wait_with_output()?;
    let messages = String::from_utf8_lossy(&output.stderr).replace("<stdin>", &label.to_string());
    ensure!(output.status.success(), "glslc refused {label}:\n{messages}");
    Ok(output.stdout)
}

/// Replaces `#include "name"` by the file, the first time that a kernel asks for it and by nothing after that, so that
/// files may include what they need. Line directives keep places in messages right. Not left to `glslc -I`: a packaged crate finds
/// its compiled kernels by the whole text, where there is no `glslc`, and the interface is in comments, which `glslc -E` drops.
fn expand(file: &str, text: &str, sources: &mut Vec<Source>) -> Result<String> {
    let mut whole = String::new();
    for (index, line) in text.lines().enumerate() {
        let Some(rest) = line.strip_prefix("#include") else {
            whole += &format!("{line}\n");
            continue;
        };
        let place = || format!("{file}:{}: {line}", index + 1);
        let name = rest.split('"').nth(1).with_context(|| format!("{}\nexpected #include \"name\"", place()))?;
        let path = format!("glsl/{name}");
        if sources.iter().all(|(seen, _)| *seen != path) {
            let content = if path == EFFECTS { effects() } else { fs::read_to_string(&path).with_context(place)? };
            sources.push((path.clone(), content.clone()));
            whole += &format!("#line 1 \"{path}\"\n{}", expand(&path, &content, sources)?);
        }
        whole += &format!("#line {} \"{file}\"\n", index + 2);
    }
    Ok(whole)
}

/// One specialisation constant an effect, whose place in the list is its id.
fn effects() -> String {
    let line = |(id, name): (usize, &&str)| format!("layout(constant_id = {id}) const bool {name} = true;\n");
    layout::GLSL_NAMES.iter().enumerate().map(line).collect()
}
