//! Converts a JSON description into the tables of a scene file.
use super::description::{Bitmap, Bsdf, Camera, Color, Description, Emitter, Index, Integrator, Material, Shape};
use super::mitsuba;
use anyhow::{Context, bail, ensure};
use std::path::Path;
use toml::{Table, Value};

/// Depth for paths without a limit, which only roulette ends. It is the largest that Tallow allows.
const UNLIMITED: i64 = 1024;
/// Depth at which roulette begins, large enough that it adds little noise.
const ROULETTE_DEPTH: i64 = 16;

/// What the conversion of a material needs in addition to the description.
pub struct Place<'a> {
    /// The scene's name, for files made beside the scene file.
    pub name: &'a str,
    /// Folder that file names are relative to.
    pub folder: &'a Path,
    /// Folder of the scene file.
    pub out: &'a Path,
    /// Whether to reproduce the picture that Mitsuba makes; see the module `mitsuba`.
    pub is_mitsuba: bool,
}

/// Converts the JSON description at `json` into a scene file.
pub fn scene(name: &str, json: &Path, out: &Path, is_mitsuba: bool) -> anyhow::Result<Table> {
    let place = Place { name, folder: json.parent().unwrap_or(Path::new(".")), out, is_mitsuba };
    let mut scene = build(&place, json).with_context(|| format!("{}", json.display()))?;
    if let (true, Some(camera)) = (is_mitsuba, scene["camera"].as_table_mut()) {
        camera.insert("fov".into(), mitsuba::FOV.into());
    }
    Ok(scene)
}

fn build(place: &Place, json: &Path) -> anyhow::Result<Table> {
    let text = std::fs::read_to_string(json).context("cannot be read")?;
    let description: Description = serde_json::from_str(&text).context("says something that is not modelled")?;
    let mut scene = film_and_camera(&description.camera)?;
    scene.insert("render".into(), render(&description.integrator).into());
    let mut lights = vec![];
    for emitter in &description.emitters {
        match emitter {
            Emitter::Constant { .. } | Emitter::Envmap { .. } => {
                let environment = environment(place, emitter)?;
                let before = scene.insert("environment".into(), environment.into());
                ensure!(before.is_none(), "two environments: only one is modelled");
            }
            _ => lights.push(Value::Table(light(emitter)?)),
        }
    }
    if !lights.is_empty() {
        scene.insert("light".into(), lights.into());
    }
    let materials = description
        .materials
        .iter()
        .map(|(name, m)| material(place, name, m).map(Value::Table).with_context(|| format!("material `{name}`")));
    scene.insert("material".into(), materials.collect::<anyhow::Result<Vec<_>>>()?.into());
    let meshes = description
        .shapes
        .iter()
        .map(|shape| mesh(place, shape).map(Value::Table).with_context(|| format!("shape `{}`", shape.id)));
    scene.insert("mesh".into(), meshes.collect::<anyhow::Result<Vec<_>>>()?.into());
    Ok(scene)
}

/// Makes a table from pairs of keys and values.
pub fn table<const N: usize>(pairs: [(&str, Value); N]) -> Table {
    pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

pub fn numbers(values: impl IntoIterator<Item = f64>) -> Value {
    // Adding 0 turns -0 into 0, which is easier to read.
    Value::Array(values.into_iter().map(|v| Value::Float(v + 0.0)).collect())
}

fn film_and_camera(camera: &Camera) -> anyhow::Result<Table> {
    let Camera::Perspective { origin, forward, up, right, fov_y_deg, width, height, rfilter, .. } = camera;
    ensure!(["box", "tent", "gaussian"].contains(&rfilter.as_str()), "the pixel filter `{rfilter}` is not modelled");
    let film = table([
        ("width", i64::from(*width).into()),
        ("height", i64::from(*height).into()),
        ("filter", rfilter.as_str().into()),
    ]);
    let rows = (0..3).flat_map(|i| [right[i], up[i], -forward[i], origin[i]]).chain([0.0, 0.0, 0.0, 1.0]);
    let camera = table([("world_from_camera", numbers(rows)), ("fov", (*fov_y_deg).into())]);
    Ok(table([("film", film.into()), ("camera", camera.into())]))
}

fn render(integrator: &Integrator) -> Table {
    let depth = match integrator {
        Integrator::Direct {} => 2,
        Integrator::Path { max_depth: -1 } => UNLIMITED,
        Integrator::Path { max_depth } => *max_depth,
    };
    let roulette = if depth > ROULETTE_DEPTH { ROULETTE_DEPTH } else { 0 };
    table([("max_depth", depth.into()), ("roulette_depth", roulette.into())])
}

/// Returns the absolute path of a file, which must exist.
pub fn file(folder: &Path, name: &str) -> anyhow::Result<Value> {
    let path = folder.join(name);
    ensure!(path.is_file(), "{} is missing", path.display());
    Ok(path.display().to_string().into())
}

fn environment(place: &Place, emitter: &Emitter) -> anyhow::Result<Table> {
    match emitter {
        Emitter::Constant { radiance, .. } => Ok(table([("radiance", numbers(*radiance))])),
        Emitter::Envmap { filename } if place.is_mitsuba => {
            let path = mitsuba::environment(place, filename)?;
            Ok(table([("file", path.display().to_string().into())]))
        }
        Emitter::Envmap { filename } => Ok(table([("file", file(place.folder, filename)?)])),
        _ => bail!("not an environment"),
    }
}

fn light(emitter: &Emitter) -> anyhow::Result<Table> {
    Ok(match emitter {
        Emitter::Point { position, intensity } => {
            table([("type", "point".into()), ("position", numbers(*position)), ("intensity", numbers(*intensity))])
        }
        Emitter::Directional { direction, irradiance } => table([
            ("type", "directional".into()),
            ("direction", numbers(*direction)),
            ("irradiance", numbers(*irradiance)),
        ]),
        _ => bail!("not a light"),
    })
}

fn mesh(place: &Place, shape: &Shape) -> anyhow::Result<Table> {
    let mut mesh = table([("name", shape.id.as_str().into()), ("material", shape.material.as_str().into())]);
    match shape.kind.as_str() {
        "obj" => {
            let name = shape.file.as_deref().context("names no OBJ file")?;
            mesh.insert("file".into(), file(place.folder, name)?);
        }
        "rectangle" | "cube" | "sphere" => _ = mesh.insert("shape".into(), shape.kind.as_str().into()),
        kind => bail!("the shape type `{kind}` is not modelled; convert it to OBJ"),
    }
    if let Some(transform) = transform(shape)? {
        mesh.insert("transform".into(), numbers(transform));
    }
    Ok(mesh)
}

/// The transform of the unit shape or file, row-major; `None` if it is the identity.
fn transform(shape: &Shape) -> anyhow::Result<Option<Vec<f64>>> {
    let mut m = shape.to_world_row_major.unwrap_or(std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j))));
    ensure!(m[3] == [0.0, 0.0, 0.0, 1.0], "its transform is not affine");
    if let (Some(center), Some(radius)) = (shape.center, shape.radius) {
        for row in m.iter_mut().take(3) {
            row[3] += (0..3).map(|k| row[k] * center[k]).sum::<f64>();
            row.iter_mut().take(3).for_each(|v| *v *= radius);
        }
    }
    let identity = (0..4).all(|i| (0..4).all(|j| m[i][j] == f64::from(i == j)));
    Ok((!identity).then(|| m.concat()))
}

fn material(place: &Place, name: &str, material: &Material) -> anyhow::Result<Table> {
    let mut out = table([("name", name.into()), ("two_sided", false.into())]);
    bsdf(place, &material.bsdf, &mut out)?;
    if let Some(radiance) = material.emission {
        out.insert("emission".into(), numbers(radiance));
    }
    Ok(out)
}

/// Adds the parameters of the BSDF to `out`.
fn bsdf(place: &Place, model: &Bsdf, out: &mut Table) -> anyhow::Result<()> {
    let mut kind = |name: &str| _ = out.insert("type".into(), name.into());
    match model {
        Bsdf::Twosided { bsdf: inner, .. } => {
            out.insert("two_sided".into(), true.into());
            bsdf(place, inner, out)?;
        }
        Bsdf::Mask { opacity, bsdf: inner } => {
            mask(place, opacity, out)?;
            bsdf(place, inner, out)?;
        }
        Bsdf::Diffuse { reflectance, .. } => {
            kind("diffuse");
            color(place, reflectance.as_ref().unwrap_or(&Color::Constant([0.5; 3])), out)?;
        }
        Bsdf::Conductor { eta, k } => {
            kind("conductor");
            out.extend(table([("alpha", 0.0.into()), ("eta", numbers(*eta)), ("k", numbers(*k))]));
        }
        Bsdf::RoughConductor { alpha, distribution, eta, k, specular_reflectance } => {
            kind("conductor");
            rough(*alpha, distribution, out)?;
            out.extend(table([("eta", numbers(*eta)), ("k", numbers(*k))]));
            out.extend(specular_reflectance.map(|s| ("specular".into(), numbers(s))));
        }
        Bsdf::Dielectric { int_ior, ext_ior } => {
            kind("dielectric");
            out.extend(table([("alpha", 0.0.into()), ("ior", ratio(int_ior, ext_ior)?)]));
        }
        Bsdf::RoughDielectric { alpha, distribution, int_ior, ext_ior } => {
            kind("dielectric");
            rough(*alpha, distribution, out)?;
            out.insert("ior".into(), ratio(int_ior, ext_ior)?);
        }
        Bsdf::Plastic { diffuse_reflectance, int_ior, ext_ior } => {
            kind("coated");
            out.extend(table([("alpha", 0.0.into()), ("ior", ratio(int_ior, ext_ior)?)]));
            color(place, diffuse_reflectance, out)?;
        }
        Bsdf::RoughPlastic { alpha, distribution, diffuse_reflectance, int_ior, ext_ior } => {
            kind("coated");
            rough(*alpha, distribution, out)?;
            out.insert("ior".into(), ratio(int_ior, ext_ior)?);
            match diffuse_reflectance {
                Color::Constant(rgb) if place.is_mitsuba => {
                    let index = int_ior.value()? / ext_ior.value()?;
                    let darker = mitsuba::under_rough_coat(index, *alpha, distribution == "ggx");
                    out.insert("color".into(), numbers(rgb.map(|v| v * darker)));
                }
                as_it_is => color(place, as_it_is, out)?,
            }
        }
    }
    Ok(())
}

fn rough(alpha: f64, distribution: &str, out: &mut Table) -> anyhow::Result<()> {
    ensure!(["beckmann", "ggx"].contains(&distribution), "the distribution `{distribution}` is not modelled");
    out.extend(table([("alpha", alpha.into()), ("distribution", distribution.into())]));
    Ok(())
}

fn ratio(interior: &Index, exterior: &Index) -> anyhow::Result<Value> {
    Ok((interior.value()? / exterior.value()?).into())
}

fn color(place: &Place, color: &Color, out: &mut Table) -> anyhow::Result<()> {
    match color {
        Color::Constant(rgb) => out.insert("color".into(), numbers(*rgb)),
        Color::Bitmap(Bitmap::Bitmap { filename, .. }) => {
            out.insert("color".into(), numbers([1.0; 3]));
            out.insert("color_texture".into(), file(place.folder, filename)?)
        }
    };
    Ok(())
}

fn mask(place: &Place, opacity: &Color, out: &mut Table) -> anyhow::Result<()> {
    match opacity {
        Color::Constant(_) => bail!("a constant opacity is not modelled"),
        Color::Bitmap(Bitmap::Bitmap { filename, .. }) => {
            let path = mitsuba::grey_mask(place, filename)?;
            out.insert("opacity_texture".into(), path.display().to_string().into());
        }
    }
    Ok(())
}
