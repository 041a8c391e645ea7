//! Governance and permissions, as DDS Security 1.1, 9.4.1 has them; its domains end at 230, and Cyclone DDS refuses others.

use std::fmt::Write as _;

use node_runtime::access::Access;

use super::authority::Validity;

/// Greatest domain that documents may name.
const LAST_DOMAIN: u16 = 230;

/// Who may take part, what is protected and how: every packet is encrypted and signed as a whole, with keys that only
/// participants have whom the authority admits; who may write and read which topic stands in their permissions.
///
/// SROS 2 protects each endpoint besides, with keys of its own. RustDDS 0.15 loses some of these where participants have
/// many endpoints ("Could not find a remote EndpointCryptoHandle"), and calls of services go unanswered. Without them, who
/// is admitted and reads the wire could decipher what it may not subscribe to.
pub fn governance() -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id_range><min>0</min><max>{LAST_DOMAIN}</max></id_range></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>ENCRYPT</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>NONE</metadata_protection_kind>
          <data_protection_kind>NONE</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
"#
    )
}

/// What the holder of a certificate may do. Names are ROS's own, of which none needs an escape.
pub fn permissions(enclave: &str, access: &Access, validity: &Validity) -> String {
    let topics = |verb: &str, all: &mut dyn Iterator<Item = &String>| {
        let mut text = format!("        <{verb}>\n          <topics>\n");
        for topic in all {
            let _ = writeln!(text, "            <topic>{topic}</topic>");
        }
        text + &format!("          </topics>\n        </{verb}>\n")
    };
    let publish = topics("publish", &mut access.publish.iter());
    let subscribe = topics("subscribe", &mut access.subscribe.iter());
    let [from, until] = [validity.from, validity.until].map(|at| at.format("%Y-%m-%dT%H:%M:%S"));
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="{enclave}">
      <subject_name>CN={enclave}</subject_name>
      <validity><not_before>{from}</not_before><not_after>{until}</not_after></validity>
      <allow_rule>
        <domains><id_range><min>0</min><max>{LAST_DOMAIN}</max></id_range></domains>
{publish}{subscribe}      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
"#
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn documents_name_no_domain_beyond_those_of_the_standard() {
        let document = governance();
        let document = roxmltree::Document::parse(&document).unwrap();
        let last = document
            .descendants()
            .find(|node| node.has_tag_name("max"))
            .and_then(|node| node.text());
        // Cyclone DDS 0.10.2 refuses a document with 231 or more.
        assert_eq!(last.unwrap().parse::<u16>().unwrap(), 230);
    }
}
