// A participant that was changed: it does not ask its own permissions before it writes. To be loaded in front of Fast DDS,
// whose own check this is.
#include <cstdint>
#include <string>
#include <vector>

namespace eprosima::fastrtps::rtps::security {

class Handle;
class SecurityException;

struct Permissions {
  bool check_create_datawriter(const Handle&, uint32_t, const std::string&, const std::vector<std::string>&,
                               SecurityException&);
};

bool Permissions::check_create_datawriter(const Handle&, uint32_t, const std::string&,
                                          const std::vector<std::string>&, SecurityException&) {
  return true;
}

}  // namespace eprosima::fastrtps::rtps::security
