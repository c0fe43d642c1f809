//! `tallow devices`: lists the Vulkan devices with their limits and missing features.
use super::{Exit, print, print_json};
use crate::error::Result;
use crate::gpu;
use crate::report::table;
use serde::Serialize;

/// List the Vulkan devices, their drivers and limits, and which required feature is missing
#[derive(clap::Args)]
pub struct Args {
    /// Print one JSON array
    #[arg(long)]
    json: bool,
}

/// One device, as printed.
#[derive(Clone, Debug, Serialize)]
pub struct Device {
    /// Index, which `--device` accepts instead of the name.
    pub index: usize,
    /// The driver's name for it.
    pub name: String,
    /// Kind: "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other".
    pub kind: String,
    /// Name and version of the driver.
    pub driver: String,
    /// Highest Vulkan version that it supports, as major.minor.patch.
    pub api: String,
    /// Name and value of each limit that matters to Tallow.
    pub limits: Vec<(String, u64)>,
    /// Required features and versions that it lacks; empty if it can be used.
    pub missing: Vec<String>,
    /// Extensions and features that it lacks for `--tracing ray-query`; empty if it can trace so.
    pub ray_query_lacks: Vec<String>,
}

/// Runs the subcommand.
///
/// # Errors
/// [`crate::error::Error::Device`] when there is no Vulkan loader or no device.
pub fn run(args: &Args) -> Result<Exit> {
    let devices = survey()?;
    if args.json {
        print_json(&devices)?;
    } else {
        print(&text(&devices))?;
    }
    Ok(Exit::Done)
}

fn survey() -> Result<Vec<Device>> {
    Ok(gpu::survey()?.into_iter().enumerate().map(|(index, info)| device(index, info)).collect())
}

fn device(index: usize, info: gpu::DeviceInfo) -> Device {
    let limits = [
        ("max storage buffer range, bytes", info.max_storage_range),
        ("max texel buffer elements", info.max_texel_elements),
        ("max buffer size, bytes", info.max_buffer_size),
        ("max allocation, bytes", info.max_allocation),
        ("largest device heap, bytes", info.memory_heap),
        ("subgroup size", info.subgroup_size.into()),
        ("timestamp valid bits", info.timestamp_bits.into()),
    ];
    Device {
        index,
        name: info.name,
        kind: info.kind.to_string(),
        driver: format!("{} {}", info.driver_name, info.driver_info),
        api: info.api_version,
        limits: limits.map(|(name, value)| (name.to_owned(), value)).into(),
        missing: info.missing.into_iter().map(str::to_owned).collect(),
        ray_query_lacks: info.ray_query_lacks.into_iter().map(str::to_owned).collect(),
    }
}

/// Formats a table of the devices, followed by the limits and the missing features of each.
fn text(devices: &[Device]) -> String {
    let usable = |d: &Device| if d.missing.is_empty() { "yes" } else { "no" }.to_owned();
    let cells = |d: &Device| {
        vec![d.index.to_string(), d.name.clone(), d.kind.clone(), d.driver.clone(), d.api.clone(), usable(d)]
    };
    let rows: Vec<_> = devices.iter().map(cells).collect();
    let details: String = devices.iter().map(details).collect();
    table::text(&["", "device", "kind", "driver", "Vulkan", "usable"], &rows) + &details
}

fn details(device: &Device) -> String {
    let or = |list: &[String], none: &str| if list.is_empty() { none.to_owned() } else { list.join(", ") };
    let missing = or(&device.missing, "nothing");
    let lacks = or(&device.ray_query_lacks, "nothing");
    let limits: Vec<_> =
        device.limits.iter().map(|(name, value)| vec![format!("  {name}"), value.to_string()]).collect();
    let head = format!("\n{} {}: missing: {missing}; for ray queries: {lacks}\n", device.index, device.name);
    head + &table::text(&["  limit", "value"], &limits)
}

#[cfg(test)]
mod tests {
    use super::{Device, text};

    #[test]
    fn the_table_names_what_a_device_lacks() {
        let mut device = Device {
            index: 0,
            name: "llvmpipe".to_owned(),
            kind: "CPU".to_owned(),
            driver: "llvmpipe 22.3.6".to_owned(),
            api: "1.3.230".to_owned(),
            limits: vec![("maxStorageBufferRange".to_owned(), 134_217_728)],
            missing: vec![],
            ray_query_lacks: vec![],
        };
        assert!(text(&[device.clone()]).contains("yes\n"));
        device.missing = vec!["shaderInt64".to_owned()];
        device.ray_query_lacks = vec!["VK_KHR_ray_query".to_owned()];
        let lacking = text(&[device]);
        assert!(lacking.contains("no\n") && lacking.contains("missing: shaderInt64"), "{lacking}");
        assert!(lacking.contains("for ray queries: VK_KHR_ray_query"), "{lacking}");
    }
}
