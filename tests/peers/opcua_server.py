"""A machine behind PyPI `asyncua` as an OPC UA server, driven line by line.

    opcua_server.py '{"port": 4840, "namespaces": ["urn:abbe:machine"], "values": {"X": 1.5}, "secured": "FOLDER"}'

The namespaces are registered in the order of the list, so their indices follow it; the values are variables of the
object `Machine` in `urn:abbe:machine`, with their names as identifiers. With `secured` the one endpoint is `policy`
(Basic256Sha256 without it) with Sign&Encrypt, and key and certificate are made in that folder; with `user`, a name with
a password, nobody else is let in. With `nodesets`, a folder, a machine tool by OPC 40501-1 stands among the machines and
a control by OPC 40502 below `Objects`.

Events go to standard output, one JSON object a line: `ready`, then `done` for each command. Commands come on standard
input: {"write": NAME, "value": V, "status": NUMBER, "at_s": SECONDS} writes one value; {"burst": COUNT, "names": [...],
"per_s": RATE} writes numbers from 0 on, in turn to the names, without a pause or at a rate, and `done` has the seconds
that it took; {"rows": [[NAME, VALUE, NANOSECONDS], ...]} writes values with their stamps. The end of standard input
ends the program.
"""

from __future__ import annotations

import asyncio
import datetime
import gzip
import ipaddress
import json
import sys
import time
from pathlib import Path

from asyncua import Server, ua
from asyncua.common.instantiate_util import instantiate
from asyncua.crypto.permission_rules import User, UserRole

MACHINE = "urn:abbe:machine"
APPLICATION = "urn:abbe:test:server"
# In the order in which they need each other.
NODESETS = [
    "Opc.Ua.Di.NodeSet2.xml",
    "Opc.Ua.IA.NodeSet2.xml",
    "Opc.Ua.Machinery.NodeSet2.xml",
    "opc.ua.isa95-jobcontrol.nodeset2.xml",
    "Opc.Ua.Machinery.Jobs.Nodeset2.xml",
    "Opc.Ua.MachineTool.NodeSet2.xml",
    "Opc.Ua.CNC.NodeSet.xml",
]
EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)


def said(**event) -> None:
    print(json.dumps(event), flush=True)


def made_certificate(folder: Path) -> tuple[Path, Path]:
    """A key and a certificate that it signs itself."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Abbe test server")])
    now = datetime.datetime.now(datetime.timezone.utc)
    alternatives = [
        x509.UniformResourceIdentifier(APPLICATION),
        x509.DNSName("localhost"),
        x509.IPAddress(ipaddress.ip_address("127.0.0.1")),
    ]
    usage = x509.KeyUsage(True, True, True, True, False, True, False, False, False)
    purposes = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=2))
        .add_extension(x509.SubjectAlternativeName(alternatives), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
        .sign(key, hashes.SHA256())
    )
    key_file, certificate_file = folder / "key.pem", folder / "certificate.der"
    key_file.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    certificate_file.write_bytes(certificate.public_bytes(serialization.Encoding.DER))
    return key_file, certificate_file


class Types:
    """Types of the published node sets, and things that are made of them."""

    def __init__(self, server: Server, index: int) -> None:
        self.server, self.index, self.by_name = server, index, {}

    async def read(self, folder: Path) -> None:
        for name in NODESETS:
            text = gzip.decompress((folder / f"{name}.gz").read_bytes()).decode()
            # asyncua cannot make some of their structures; no node below is of such a type.
            await self.server.import_xml(xmlstring=text, strict_mode=False)
        await self.look_below(self.server.nodes.base_object_type)

    async def look_below(self, kind) -> None:
        for child in await kind.get_children(refs=ua.ObjectIds.HasSubtype):
            self.by_name[(await child.read_browse_name()).Name] = child
            await self.look_below(child)

    async def made(self, parent, kind: str, name: str):
        name = ua.QualifiedName(name, self.index)
        made = await instantiate(
            parent, self.by_name[kind], bname=name, instantiate_optional=True, idx=self.index
        )
        return made[0]


async def written(namespace: int, values: list) -> dict:
    """Writes values below parents by their path; the nodes by the last name."""
    variables = {}
    for parent, path, value, kind in values:
        variable = await parent.get_child([name if ":" in name else f"{namespace}:{name}" for name in path.split("/")])
        await variable.write_value(ua.Variant(value, ua.VariantType[kind]))
        variables[path.split("/")[-1]] = variable
    return variables


async def machine_tool(types: Types) -> dict:
    """A machine tool with one channel and one spindle."""
    server = types.server
    tool = await server.get_namespace_index("http://opcfoundation.org/UA/MachineTool/")
    machinery = await server.get_namespace_index("http://opcfoundation.org/UA/Machinery/")
    machines = await server.nodes.objects.get_child(f"{machinery}:Machines")
    mill = await types.made(machines, "MachineToolType", "Mill")
    monitoring = await mill.get_child(f"{tool}:Monitoring")
    channel = await types.made(monitoring, "ChannelMonitoringType", "Channel 1")
    spindle = await types.made(monitoring, "SpindleMonitoringType", "Spindle 1")
    program = await mill.get_child([f"{tool}:Production", f"{tool}:ActiveProgram"])
    values = [
        (channel, "ChannelState", 0, "Int32"),
        (channel, "ChannelMode", 1, "Int32"),
        (channel, "RapidOverride", 50.0, "Double"),
        (spindle, "IsRotating", True, "Boolean"),
        (spindle, "Override", 80.0, "Double"),
        (monitoring, "MachineTool/OperationMode", 1, "Int32"),
        (program, "Name", "part_7", "String"),
        (program, "State/0:CurrentState", ua.LocalizedText("Running"), "LocalizedText"),
    ]
    return await written(tool, values)


async def control(types: Types) -> dict:
    """A control with axes X, Y and Z, one channel and one spindle."""
    cnc = await types.server.get_namespace_index("http://opcfoundation.org/UA/CNC")
    control = await types.made(types.server.nodes.objects, "CncInterfaceType", "Control")
    values = []
    for at, letter in enumerate("XYZ"):
        axis = await types.made(await control.get_child(f"{cnc}:CncAxisList"), "CncAxisType", letter)
        values.append((axis, "PosIndirect/ActPos", 100.0 + at, "Double"))
        values.append((axis, "PosIndirect/CmdPos", 200.0 + at, "Double"))
    spindle = await types.made(await control.get_child(f"{cnc}:CncSpindleList"), "CncSpindleType", "S1")
    values.append((spindle, "ActSpeed", 1200.0, "Double"))
    channel = await types.made(await control.get_child(f"{cnc}:CncChannelList"), "CncChannelType", "C1")
    values.append((channel, "ActStatus", 2, "Int32"))
    return await written(cnc, values)


class OneUser:
    """Lets one user in."""

    def __init__(self, name: str, password: str) -> None:
        self.name, self.password = name, password

    def get_user(self, iserver, username=None, password=None, certificate=None) -> User | None:
        return User(role=UserRole.User) if (username, password) == (self.name, self.password) else None


async def made_server(plan: dict) -> tuple[Server, dict]:
    server = Server(user_manager=OneUser(*plan["user"]) if "user" in plan else None)
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{plan['port']}/")
    await server.set_application_uri(APPLICATION)
    if "secured" in plan:
        key, certificate = made_certificate(Path(plan["secured"]))
        await server.load_certificate(str(certificate))
        await server.load_private_key(str(key))
        policy = plan.get("policy", "Basic256Sha256")
        server.set_security_policy([ua.SecurityPolicyType[f"{policy}_SignAndEncrypt"]])
    else:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    if "user" in plan:
        server.set_identity_tokens([ua.UserNameIdentityToken])
    for uri in plan["namespaces"]:
        await server.register_namespace(uri)
    index = await server.get_namespace_index(MACHINE)
    machine = await server.nodes.objects.add_object(index, "Machine")
    variables = {}
    for name, value in plan["values"].items():
        node = ua.NodeId(name, index)
        variables[name] = await machine.add_variable(node, name, value)
    if "nodesets" in plan:
        types = Types(server, index)
        await types.read(Path(plan["nodesets"]))
        variables |= await machine_tool(types)
        variables |= await control(types)
    return server, variables


async def write(variable, command: dict) -> None:
    value = command["value"]
    kind = ua.VariantType.Double if isinstance(value, float) else None
    at = datetime.datetime.fromtimestamp(command["at_s"], datetime.timezone.utc)
    data = ua.DataValue(
        Value=ua.Variant(value, kind),
        StatusCode=ua.StatusCode(command.get("status", 0)),
        SourceTimestamp=at,
        ServerTimestamp=at,
    )
    await variable.write_value(data)


async def burst(variables: dict, command: dict) -> float:
    names, rate = command["names"], command.get("per_s")
    begun = time.monotonic()
    for number in range(command["burst"]):
        await variables[names[number % len(names)]].write_value(float(number))
        # Others have their turn: the server answers while it writes.
        if number % 100 == 99:
            due = begun + (number + 1) / rate if rate else 0.0
            await asyncio.sleep(max(0.0, due - time.monotonic()))
    return time.monotonic() - begun


async def rows(server: Server, variables: dict, command: dict) -> None:
    for name, value, nanos in command["rows"]:
        at = EPOCH + datetime.timedelta(microseconds=nanos / 1000)
        variant = ua.Variant(value, ua.VariantType.Double if isinstance(value, (int, float)) and not isinstance(value, bool) else None)
        data = ua.DataValue(Value=variant, SourceTimestamp=at, ServerTimestamp=at)
        await server.write_attribute_value(variables[name].nodeid, data)


async def main() -> None:
    server, variables = await made_server(json.loads(sys.argv[1]))
    loop = asyncio.get_running_loop()
    async with server:
        said(event="ready")
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            command = json.loads(line)
            took_s = None
            if "burst" in command:
                took_s = await burst(variables, command)
            elif "rows" in command:
                await rows(server, variables, command)
            else:
                await write(variables[command["write"]], command)
            said(event="done", took_s=took_s)


asyncio.run(main())
